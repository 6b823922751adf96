"""Reader of TUM RGB-D sequences: depth images with stamps, and the poses of a camera.

Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems", 2012, and its file formats.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from wayproof.harness.recordings.depth import Intrinsics
from wayproof.harness.recordings.depth_files import DepthFiles
from wayproof.harness.recordings.folders import (
    FolderContents,
    SweepFile,
    new_faults,
    open_folder,
)
from wayproof.harness.recordings.matrices import OPTICAL, of_body
from wayproof.harness.recordings.poses import StampedPoses
from wayproof.harness.recordings.recording import Faults, Recording, RecordingOptions
from wayproof.harness.recordings.text import beside, nanoseconds, rows

DEPTHS, POSES = "depth.txt", "groundtruth.txt"
UNITS_PER_METRE = 5000.0

CAMERAS: dict[str, Intrinsics] = {
    "freiburg1": (517.3, 516.5, 318.6, 255.3),
    "freiburg2": (520.9, 521.0, 325.1, 249.7),
    "freiburg3": (535.4, 539.2, 320.1, 247.6),
}
"""Intrinsics of the three cameras of the benchmark, by a part of the folder's name."""

USUAL: Intrinsics = (525.0, 525.0, 319.5, 239.5)
"""Intrinsics that the benchmark gives for its cameras if none is preferred."""


def looks_like(path: Path) -> bool:
    """Return whether a folder has the two lists."""
    return (path / DEPTHS).is_file() and (path / POSES).is_file()


def open_sequence(path: Path, options: RecordingOptions) -> Recording:
    """Open a sequence; the body is the camera, with x ahead and z up.

    Raises:
        InputError: It has no image or no pose.
    """
    faults = new_faults()
    near = next((one for name, one in CAMERAS.items() if name in path.name.lower()), USUAL)
    intrinsics = options.intrinsics or near
    read = DepthFiles(intrinsics, options.depth_scale or UNITS_PER_METRE, options.pixel_stride)
    contents = FolderContents(
        format="tum",
        sensor="depth",
        kind="depth",
        files=_files(path, faults),
        poses=of_body(_poses(path, faults), OPTICAL, turn_world=False),
        mount=OPTICAL,
        source=POSES,
        chosen=f"intrinsics {','.join(f'{value:g}' for value in intrinsics)}",
        others=[path / DEPTHS, path / POSES],
        read=read,
    )
    return open_folder(path, contents, options, faults)


def _files(path: Path, faults: Faults) -> list[SweepFile]:
    """Return the images of the list, in its order."""
    files = []
    for words in rows(path / DEPTHS):
        try:
            files.append(SweepFile(nanoseconds(words[0]), beside(path, words[1])))
        except (ValueError, ArithmeticError, IndexError, OSError):
            faults["line: not an image"] += 1
    return files


def _poses(path: Path, faults: Faults) -> StampedPoses:
    """Return the poses of the camera's optical frame: stamp, tx ty tz, qx qy qz qw."""
    stamps, numbers = [], []
    for words in rows(path / POSES):
        try:
            row = [float(word) for word in words[1:8]]
            if len(row) != 7:
                raise ValueError
            stamps.append(nanoseconds(words[0]))
            numbers.append(row)
        except (ValueError, ArithmeticError):
            faults["line: not a pose"] += 1
    table = np.array(numbers, np.float64).reshape(-1, 7)
    quaternions = np.roll(table[:, 3:], 1, axis=1)
    return StampedPoses(np.array(stamps, np.int64), table[:, :3], quaternions)
