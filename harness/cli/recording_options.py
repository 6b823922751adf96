"""Options of verbs that read a recording."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from wayproof.harness.errors import InputError

if TYPE_CHECKING:
    from wayproof.harness.recordings.recording import RecordingOptions


def add_recording(parser: argparse.ArgumentParser) -> None:
    """Add the recording, and the options that choose what is read of it."""
    parser.add_argument("recording", metavar="RECORDING", type=Path, help="file or folder")
    parser.add_argument("--format", metavar="NAME", help="format (default: found)")
    parser.add_argument(
        "--sensor",
        action="append",
        default=[],
        metavar="TOPIC",
        help="sensor to read, repeatable (default: the only one)",
    )
    parser.add_argument(
        "--pose", metavar="TOPIC", help="topic or frame of the poses (default: the only one)"
    )
    parser.add_argument("--body", metavar="FRAME", help="frame of the body (default: the poses')")
    parser.add_argument(
        "--mount",
        metavar="X,Y,Z[,YAW[,PITCH[,ROLL]]]",
        help="sensor in the body's frame, m and degrees, where the recording does not say; of a "
        "folder the body under the sensor whose poses it has",
    )
    parser.add_argument("--begin", type=float, default=0.0, metavar="S", help="first second read")
    parser.add_argument("--end", type=float, metavar="S", help="last second read")
    parser.add_argument("--range-max", type=float, metavar="M", help="longest range that counts, m")
    parser.add_argument(
        "--max-gap",
        type=float,
        default=1.0,
        metavar="S",
        help="longest time between two poses (default: 1)",
    )
    parser.add_argument(
        "--intrinsics",
        metavar="FX,FY,CX,CY",
        help="of depth images, pixels, where the recording does not say",
    )
    parser.add_argument(
        "--depth-scale",
        type=float,
        metavar="N",
        help="units of a depth image in a metre (default: the format's)",
    )
    parser.add_argument(
        "--pixel-stride",
        type=int,
        default=4,
        metavar="N",
        help="read each N-th row and column of depth images (default: 4)",
    )
    parser.add_argument(
        "--no-return-is-free",
        action="store_true",
        default=None,
        help="a beam without return was free up to the longest range",
    )


def options_of(options: argparse.Namespace) -> RecordingOptions:
    """Read the options.

    Raises:
        InputError: A mount or intrinsics are not made of as many numbers.
    """
    from wayproof.harness.recordings.poses import mount_of
    from wayproof.harness.recordings.recording import RecordingOptions

    return RecordingOptions(
        format=options.format,
        sensors=tuple(options.sensor),
        pose=options.pose,
        body=options.body,
        mount=None if options.mount is None else mount_of(_numbers("--mount", options.mount)),
        start_s=options.begin,
        end_s=options.end,
        range_max=options.range_max,
        missing_returns_free=options.no_return_is_free,
        intrinsics=None if options.intrinsics is None else _intrinsics(options.intrinsics),
        depth_scale=options.depth_scale,
        pixel_stride=options.pixel_stride,
        max_gap_s=options.max_gap,
    )


def _numbers(name: str, text: str) -> list[float]:
    """Read numbers with commas between them."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"{name} {text}: expected numbers with commas between them") from None


def _intrinsics(text: str) -> tuple[float, float, float, float]:
    numbers = _numbers("--intrinsics", text)
    if len(numbers) != 4:
        raise InputError(f"--intrinsics {text}: expected FX,FY,CX,CY, in pixels")
    fx, fy, cx, cy = numbers
    return fx, fy, cx, cy
