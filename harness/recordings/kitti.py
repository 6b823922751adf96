"""Reader of folders of point clouds with poses, as those of the KITTI odometry benchmark.

Geiger et al., "Are we ready for autonomous driving?", 2012, and its file formats.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.recordings.beams import Beams, Limits, point_beams
from wayproof.harness.recordings.folders import (
    FolderContents,
    SweepFile,
    Unreadable,
    new_faults,
    open_folder,
)
from wayproof.harness.recordings.matrices import OPTICAL, of_body, stamped
from wayproof.harness.recordings.poses import inverse
from wayproof.harness.recordings.recording import Faults, Recording, RecordingOptions
from wayproof.harness.recordings.text import nanoseconds, rows
from wayproof.harness.recordings.types import IDENTITY, Transform

POSES, TIMES, CALIBRATION = "poses.txt", "times.txt", "calib.txt"
SEQUENCES = "sequences"
"""Folder of the benchmark's sequences, beside that of their poses."""

FOLDERS = ("velodyne", "velodyne_points/data", "clouds", "")
"""Folders in which the clouds may lie."""

PERIOD_NS = 100_000_000
"""Time from one sweep to the next where there are no times, ns: the lidar of KITTI turns at 10 Hz.
"""

POINT_BYTES = 16
"""Bytes of a point: x, y, z, m, and intensity, float32."""

MOST_CLOUD = 2**28

WIDTHS = (3, 4, 5, 6, 7)
"""Numbers of a point that are distinguished: nuScenes and Boreas write 5 and 6."""


def looks_like(path: Path) -> bool:
    """Return whether a folder has poses and clouds."""
    return _poses_file(path).is_file() and bool(_clouds(path))


def open_clouds(path: Path, options: RecordingOptions) -> Recording:
    """Open a folder of clouds; the body is the lidar.

    The poses of the benchmark are those of its left camera, relative to the first; `calib.txt` has
    its place on the lidar (`Tr`). Without it they are taken for the lidar's own.

    Raises:
        InputError: It has no cloud, no pose, or a calibration that is none.
    """
    faults = new_faults()
    clouds = _clouds(path)
    times = _times(path, faults)
    stamps, files = [], []
    for place, cloud in enumerate(clouds):
        number = int(cloud.stem[:9]) if re.fullmatch(r"\d{1,9}", cloud.stem) else place
        if times and number >= len(times):
            faults["sweep: no time for it"] += 1
            continue
        files.append(SweepFile(times[number] if times else number * PERIOD_NS, cloud))
    numbers = []
    poses_file = _poses_file(path)
    for k, words in enumerate(rows(poses_file)):
        matrix = _numbers(words)
        if matrix is None or (times and k >= len(times)):
            faults["line: not a pose"] += 1
            matrix = [np.nan] * 12
        numbers.append(matrix)
        stamps.append(times[k] if k < len(times) else k * PERIOD_NS)
    poses = stamped(stamps, numbers, faults)
    T_lidar_camera = _calibration(path, faults)
    if T_lidar_camera is not None:
        poses = of_body(poses, T_lidar_camera, turn_world=True)
    moved = "" if T_lidar_camera is None else " of the camera, moved to the lidar"
    contents = FolderContents(
        format="kitti",
        sensor="lidar",
        kind="points",
        files=files,
        poses=poses,
        mount=IDENTITY,
        source=poses_file.name + moved,
        chosen="" if times else f"{1e9 / PERIOD_NS:g} sweeps a second",
        others=[poses_file, path / TIMES, path / CALIBRATION],
        read=read_cloud,
    )
    return open_folder(path, contents, options, faults)


def read_cloud(path: Path, limits: Limits, faults: Faults) -> Beams:
    """Return the beams of a cloud.

    Raises:
        Unreadable: It is not made of whole points, or of more than `MOST_CLOUD` bytes.
    """
    size = path.stat().st_size
    if size % POINT_BYTES or size > MOST_CLOUD:
        raise Unreadable(f"{path}: {size} bytes, expected {POINT_BYTES} for a point")
    numbers = np.fromfile(path, "<f4")
    width = _width(numbers)
    if width != POINT_BYTES // 4:
        raise Unreadable(f"{path}: {width} numbers a point, expected 4: x, y, z, intensity")
    rows_ = numbers.reshape(-1, POINT_BYTES // 4)
    points = np.ascontiguousarray(rows_[:, :3])
    finite = np.isfinite(points).all(axis=1)
    faults["point: not finite"] += int((~finite).sum())
    return point_beams(points[finite], None, limits, faults)


def _width(numbers: NDArray[np.float32]) -> int:
    """Return how many numbers a point has: the distance at which numbers are most alike."""
    usual = POINT_BYTES // 4
    some = numbers[: 2**16].astype(np.float64)
    if len(some) < 64 * usual or not np.isfinite(some).all():
        return usual
    apart = {width: float(np.median(np.abs(some[width:] - some[:-width]))) for width in WIDTHS}
    best = min(apart, key=lambda width: apart[width])
    return best if apart[best] < 0.7 * apart[usual] else usual


def _poses_file(path: Path) -> Path:
    """Return the file of the poses: in the folder, or `../../poses/NN.txt` of `sequences/NN`."""
    whole = path.absolute()
    if not (path / POSES).is_file() and whole.parent.name == SEQUENCES:
        return whole.parent.parent / "poses" / f"{whole.name}.txt"
    return path / POSES


def _clouds(path: Path) -> list[Path]:
    for folder in FOLDERS:
        found = list((path / folder).glob("*.bin"))
        if found:
            return sorted(found, key=lambda one: (len(one.name), one.name))
    return []


def _times(path: Path, faults: Faults) -> list[int]:
    """Return the stamps of the sweeps, ns; none without the file."""
    times: list[int] = []
    if not (path / TIMES).is_file():
        return times
    for words in rows(path / TIMES):
        try:
            times.append(nanoseconds(words[0]))
        except (ValueError, ArithmeticError):
            faults["line: not a time"] += 1
            times.append(times[-1] if times else 0)  # keeps the count; its sweep is out of order
    return times


def _numbers(words: list[str]) -> list[float] | None:
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        return None
    return numbers if len(numbers) in (12, 16) else None


def _calibration(path: Path, faults: Faults) -> Transform | None:
    """Return T_lidar_camera from the line `Tr:` (T_camera_lidar); None without the file."""
    if not (path / CALIBRATION).is_file():
        return None
    for words in rows(path / CALIBRATION):
        if words[0] in ("Tr:", "Tr_velo_to_cam:"):
            matrix = _numbers(words[1:])
            given = None if matrix is None else stamped([0], [matrix], faults)
            if given is not None and len(given.stamps_ns):
                return inverse(Transform(given.positions[0], given.quaternions[0]))
            break
    faults["calibration: none, the camera's axes alone are turned"] += 1
    return OPTICAL
