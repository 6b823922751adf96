"""Reader of folders of depth images with a pose file for each (7-Scenes, ScanNet)."""

from __future__ import annotations

import re
from pathlib import Path

from wayproof.harness.recordings.depth import Intrinsics, usable
from wayproof.harness.recordings.depth_files import DepthFiles
from wayproof.harness.recordings.folders import (
    FolderContents,
    SweepFile,
    new_faults,
    open_folder,
)
from wayproof.harness.recordings.matrices import OPTICAL, is_camera_world, of_body, stamped
from wayproof.harness.recordings.recording import Faults, Recording, RecordingOptions
from wayproof.harness.recordings.text import rows

RATE = 30
"""Frames per second: the files have no stamps; this is the rate of a Kinect."""

UNITS_PER_METRE = 1000.0

USUAL: Intrinsics = (585.0, 585.0, 320.0, 240.0)
"""Intrinsics of the depth camera of 7-Scenes (Shotton et al., 2013)."""

INTRINSICS = ("camera-intrinsics.txt", "intrinsic/intrinsic_depth.txt", "intrinsics.txt")
"""Files with a matrix of intrinsics."""

LAYOUTS = (("", "*.depth.png", "{stem}.pose.txt"), ("depth", "*.png", "pose/{stem}.txt"))
"""Folder of the images, their names, and the name of the pose beside: 7-Scenes, ScanNet."""

MOST_MATRIX = 2**16


def looks_like(path: Path) -> bool:
    """Return whether a folder has an image with a pose."""
    return path.is_dir() and any(pose.is_file() for _, pose in _pairs(path)[:3])


def open_frames(path: Path, options: RecordingOptions) -> Recording:
    """Open a folder of frames; the body is the camera, with x ahead and z up.

    Where the poses are relative to some frame of a camera (7-Scenes), which is taken to have been
    level, the world is turned so that its z is up. In ScanNet it is.

    Raises:
        InputError: It has no image or no pose.
    """
    faults = new_faults()
    pairs = _pairs(path)
    found = next((path / name for name in INTRINSICS if (path / name).is_file()), None)
    intrinsics = options.intrinsics or (_intrinsics(found, faults) if found else None) or USUAL
    files, stamps, numbers = [], [], []
    for place, (image, pose) in enumerate(pairs):
        number = re.findall(r"\d+", image.name)
        stamp = stamp_of(int(number[0][:9]) if number else place)
        files.append(SweepFile(stamp, image))
        matrix = _matrix(pose) if pose.is_file() else None
        if matrix is None:
            faults["pose: no matrix"] += 1
        else:
            stamps.append(stamp)
            numbers.append(matrix)
    poses = stamped(stamps, numbers, faults)
    turned = is_camera_world(poses)
    scale = options.depth_scale or UNITS_PER_METRE
    contents = FolderContents(
        format="frames",
        sensor="depth",
        kind="depth",
        files=files,
        poses=of_body(poses, OPTICAL, turn_world=turned),
        mount=OPTICAL,
        source="a matrix for each image",
        chosen=(
            f"intrinsics {','.join(f'{value:g}' for value in intrinsics)},"
            f" {RATE} frames a second,"
            f" z up {'as the camera' if turned else 'in the poses'}"
        ),
        others=[*([found] if found else []), *(pose for _, pose in pairs)],
        read=DepthFiles(intrinsics, scale, options.pixel_stride),
    )
    return open_folder(path, contents, options, faults)


def stamp_of(number: int) -> int:
    """Return the time of a frame after that of number 0, ns; those of each tenth are exact."""
    return number * 10**9 // RATE


def _pairs(path: Path) -> list[tuple[Path, Path]]:
    """Return images with the names of their poses, in order of the numbers in their names."""
    for folder, pattern, named in LAYOUTS:
        images = sorted((path / folder).glob(pattern), key=lambda one: (len(one.name), one.name))
        if images:
            return [(one, path / named.format(stem=one.name.split(".")[0])) for one in images]
    return []


def _matrix(path: Path) -> list[float] | None:
    """Parse a matrix (4, 4) or (3, 4) from a text, row by row; None if it is invalid."""
    try:
        numbers = [float(word) for words in rows(path, MOST_MATRIX) for word in words]
    except ValueError:
        return None
    return numbers if len(numbers) in (12, 16) else None


def _intrinsics(path: Path, faults: Faults) -> Intrinsics | None:
    """Return the intrinsics of a matrix (3, 3) or (4, 4); None if it is invalid."""
    try:
        table = [[float(word) for word in words] for words in rows(path, MOST_MATRIX)]
        fx, cx, fy, cy = table[0][0], table[0][2], table[1][1], table[1][2]
    except (ValueError, IndexError):
        faults["intrinsics: no matrix"] += 1
        return None
    if not usable((fx, fy, cx, cy)):
        faults["intrinsics: no matrix"] += 1
        return None
    return fx, fy, cx, cy
