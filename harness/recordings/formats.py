"""The formats of recordings, by name, and opening a recording of any of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.recordings import carmen, frames, kitti, simulated, tum
from wayproof.harness.recordings.bags import bag
from wayproof.harness.recordings.depth import usable
from wayproof.harness.recordings.recording import Format, Recording, RecordingOptions

IMAGES = ("intrinsics", "depth_scale", "pixel_stride")
"""Options of depth images."""

FORMATS: dict[str, Format] = {
    "wayproof": Format(
        "log of an episode",
        simulated.looks_like,
        simulated.open_episode,
        without=("pose", "body", "mount", *IMAGES),
    ),
    "bag": Format(
        "ROS 1 .bag, ROS 2 .mcap or .db3, or its folder, or PX4's .ulg",
        bag.looks_like,
        bag.open_bag,
    ),
    "carmen": Format(
        "CARMEN log of laser scans",
        carmen.looks_like,
        carmen.open_log,
        without=("body", *IMAGES),
    ),
    "tum": Format(
        "TUM RGB-D sequence", tum.looks_like, tum.open_sequence, without=("pose", "body")
    ),
    "frames": Format(
        "folder of depth images and poses",
        frames.looks_like,
        frames.open_frames,
        without=("pose", "body"),
    ),
    "kitti": Format(
        "folder of KITTI clouds and poses",
        kitti.looks_like,
        kitti.open_clouds,
        without=("pose", "body", *IMAGES),
    ),
}
"""Name -> format; a path is of the first that it looks like."""


def open_recording(path: Path, *, options: RecordingOptions | None = None) -> Recording:
    """Open a recording: find its format, its sensors and its poses, and read the poses.

    Args:
        path: File or folder.
        options: Selection of it; None reads what there is one choice for.

    Raises:
        InputError: In one line: no such file, no known format, several choices, or damage.
    """
    options = options or RecordingOptions()
    _check(options)
    if not path.exists():
        raise InputError(f"recording '{path}': no such file or folder")
    if path.is_file() and path.stat().st_size == 0:
        raise InputError(f"recording '{path}': empty file")
    if options.format is not None:
        if options.format not in FORMATS:
            raise unknown_name("format of recordings", options.format, FORMATS)
        return _opened(path, options.format, options)
    for name, one in FORMATS.items():
        if one.matches(path):
            return _opened(path, name, options)
    if packed := _packed(path):
        raise InputError(
            f"recording '{path}': '{packed.name}' is packed, unpack it first (zstd -d)"
        )
    listed = ", ".join(f"{name}: {one.help}" for name, one in FORMATS.items())
    raise InputError(f"recording '{path}': of no known format ({listed})")


def _packed(path: Path) -> Path | None:
    """Return a file of a bag whose files are packed as a whole; None without one."""
    inside = [path] if path.is_file() else sorted(path.iterdir())
    return next((one for one in inside if one.suffix in (".zst", ".zstd")), None)


def _opened(path: Path, name: str, options: RecordingOptions) -> Recording:
    """Open a recording of a format.

    Raises:
        InputError: An option has no meaning for it, or as of its reader.
    """
    usual, own = RecordingOptions(), FORMATS[name]
    for option in own.without:
        if getattr(options, option) != getattr(usual, option):
            raise InputError(f"recording '{path}': {option} has no meaning for format '{name}'")
    return replace(own.open(path, options), options=options)


def _check(options: RecordingOptions) -> None:
    """Refuse options that no recording can be read with.

    Raises:
        InputError: Naming the option.
    """
    if options.intrinsics is not None and not usable(options.intrinsics):
        got = ",".join(f"{value:g}" for value in options.intrinsics)
        raise InputError(f"intrinsics {got}: expected fx,fy,cx,cy in pixels, fx and fy above 0")
    for name, value, least in (
        ("range_max", options.range_max, 1e-3),
        ("depth_scale", options.depth_scale, 1e-6),
        ("pixel_stride", options.pixel_stride, 1),
        ("max_gap_s", options.max_gap_s, 0.0),
        ("start_s", options.start_s, -1e9),
        ("end_s", options.end_s, -1e9),
    ):
        if value is not None and not least <= value <= 1e9:
            raise InputError(f"{name} {value:g}: expected {least:g} to 1e9")
