"""The formats of recordings, by name, and opening a recording of any of them."""

from __future__ import annotations

from pathlib import Path

from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.recordings import carmen, frames, kitti, simulated, tum
from wayproof.harness.recordings.bags import bag
from wayproof.harness.recordings.recording import Format, Recording, RecordingOptions

FORMATS: dict[str, Format] = {
    "wayproof": Format("log of an episode", simulated.looks_like, simulated.open_episode),
    "bag": Format("ROS 1 .bag, ROS 2 .mcap or .db3, or its folder", bag.looks_like, bag.open_bag),
    "carmen": Format("CARMEN log of laser scans", carmen.looks_like, carmen.open_log),
    "tum": Format("TUM RGB-D sequence", tum.looks_like, tum.open_sequence),
    "frames": Format("folder of depth images and poses", frames.looks_like, frames.open_frames),
    "kitti": Format("folder of KITTI clouds and poses", kitti.looks_like, kitti.open_clouds),
}
"""Name -> format; a path is of the first that it looks like."""


def open_recording(path: Path, *, options: RecordingOptions | None = None) -> Recording:
    """Open a recording: find its format, its sensors and its poses, and read the poses.

    Args:
        path: File or folder.
        options: What to read of it; None reads what there is one choice for.

    Raises:
        InputError: In one line: no such file, no known format, several choices, or damage.
    """
    options = options or RecordingOptions()
    if not path.exists():
        raise InputError(f"recording '{path}': no such file or folder")
    if path.is_file() and path.stat().st_size == 0:
        raise InputError(f"recording '{path}': empty file")
    if options.format is not None:
        if options.format not in FORMATS:
            raise unknown_name("format of recordings", options.format, FORMATS)
        return FORMATS[options.format].open(path, options)
    for one in FORMATS.values():
        if one.matches(path):
            return one.open(path, options)
    listed = ", ".join(f"{name}: {one.help}" for name, one in FORMATS.items())
    raise InputError(f"recording '{path}': of no known format ({listed})")
