"""The formats of recordings, by name, and opening a recording of any of them."""

from __future__ import annotations

from pathlib import Path

from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.recordings import carmen, folder_formats, simulated
from wayproof.harness.recordings.bags import bag
from wayproof.harness.recordings.options import RecordingOptions
from wayproof.harness.recordings.recording import Format, Recording

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
        "TUM RGB-D sequence",
        folder_formats.is_tum,
        folder_formats.open_tum,
        without=("pose", "body"),
    ),
    "frames": Format(
        "folder of depth images and poses",
        folder_formats.is_frames,
        folder_formats.open_frames,
        without=("pose", "body"),
    ),
    "kitti": Format(
        "folder of KITTI clouds and poses",
        folder_formats.is_kitti,
        folder_formats.open_kitti,
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
    options.check()
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
    own = FORMATS[name]
    for option in own.without:
        if option in options.changed():
            raise InputError(f"recording '{path}': {option} has no meaning for format '{name}'")
    try:
        return own.open(path, options)
    except InputError as error:
        if str(path) in str(error):
            raise
        raise InputError(f"recording '{path}': {error}") from None
