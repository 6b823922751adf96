"""Options of verbs that read a recording."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from wayproof.harness.errors import InputError

if TYPE_CHECKING:
    from wayproof.harness.recordings.recording import RecordingOptions
    from wayproof.harness.recordings.types import Transform


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
        metavar="X,Y,Z[,YAW]",
        help="sensor in the body's frame, m and degrees, where the recording does not say",
    )
    parser.add_argument("--begin", type=float, default=0.0, metavar="S", help="first second read")
    parser.add_argument("--end", type=float, metavar="S", help="last second read")
    parser.add_argument("--range-max", type=float, metavar="M", help="longest range that counts, m")
    parser.add_argument(
        "--no-return-is-free",
        action="store_true",
        default=None,
        help="a beam without return was free up to the longest range",
    )


def options_of(options: argparse.Namespace) -> RecordingOptions:
    """Read the options.

    Raises:
        InputError: A mount is not made of numbers.
    """
    from wayproof.harness.recordings.recording import RecordingOptions

    return RecordingOptions(
        format=options.format,
        sensors=tuple(options.sensor),
        pose=options.pose,
        body=options.body,
        mount=None if options.mount is None else _mount(options.mount),
        start_s=options.begin,
        end_s=options.end,
        range_max=options.range_max,
        missing_returns_free=options.no_return_is_free,
    )


def _mount(text: str) -> Transform:
    """Read `X,Y,Z` or `X,Y,Z,YAW`."""
    import math

    import numpy as np

    from wayproof.harness.recordings.types import Transform

    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (3, 4) or not all(map(math.isfinite, numbers)):
        raise InputError(f"--mount {text}: expected X,Y,Z or X,Y,Z,YAW, in m and degrees")
    half = 0.5 * math.radians(numbers[3]) if len(numbers) == 4 else 0.0
    quaternion = np.array([math.cos(half), 0.0, 0.0, math.sin(half)])
    return Transform(np.array(numbers[:3]), quaternion)
