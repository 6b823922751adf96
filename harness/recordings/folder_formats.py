"""Formats of folders: clouds as of KITTI, and depth images as of TUM, 7-Scenes and ScanNet."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.recordings.beams import Beams, Limits, point_beams
from wayproof.harness.recordings.folders import (
    Folder,
    depth_reader,
    matrix_of,
    nanoseconds,
    of_body,
    open_folder,
    rows,
    stamped,
)
from wayproof.harness.recordings.options import (
    Broken,
    Faults,
    Intrinsics,
    RecordingOptions,
    usable,
)
from wayproof.harness.recordings.poses import StampedPoses
from wayproof.harness.recordings.recording import Recording
from wayproof.harness.recordings.transform import IDENTITY, OPTICAL, Transform, inverse, rotate

# KITTI: Geiger et al., "Are we ready for autonomous driving?", 2012, and its file formats.

POSES, TIMES, CALIBRATION = "poses.txt", "times.txt", "calib.txt"
SEQUENCES = "sequences"
"""Folder of the benchmark's sequences, beside that of their poses."""

CLOUD_FOLDERS = ("velodyne", "velodyne_points/data", "clouds", "")
PERIOD_NS = 100_000_000
"""Time from one sweep to the next where there are no times, ns: the lidar of KITTI turns at 10 Hz.
"""

POINT_BYTES = 16
"""Bytes of a point: x, y, z, m, and intensity, float32."""

MOST_CLOUD = 2**28

WIDTHS = (3, 4, 5, 6, 7)
"""Numbers of a point that are distinguished: nuScenes and Boreas write 5 and 6."""


def is_kitti(path: Path) -> bool:
    """Return whether a folder has poses and clouds."""
    return _poses_file(path).is_file() and bool(_clouds(path))


def open_kitti(path: Path, options: RecordingOptions) -> Recording:
    """Open a folder of clouds; the body is the lidar.

    The poses of the benchmark are those of its left camera, relative to the first; `calib.txt` has
    its place on the lidar (`Tr`). Without it they are taken for the lidar's own.

    Raises:
        InputError: It has no cloud or no pose.
    """
    faults: Faults = Counter()
    times, files = _times(path, faults), []
    for place, cloud in enumerate(_clouds(path)):
        number = int(cloud.stem[:9]) if re.fullmatch(r"\d{1,9}", cloud.stem) else place
        if times and number >= len(times):
            faults["sweep: no time for it"] += 1
        else:
            files.append((times[number] if times else number * PERIOD_NS, cloud))
    stamps, numbers, poses_file = [], [], _poses_file(path)
    for k, words in enumerate(rows(poses_file)):
        matrix = matrix_of(words)
        if matrix is None or (times and k >= len(times)):
            faults["line: not a pose"] += 1
            matrix = [np.nan] * 12
        numbers.append(matrix)
        stamps.append(times[k] if k < len(times) else k * PERIOD_NS)
    poses, source = stamped(stamps, numbers, faults), poses_file.name
    T_lidar_camera = _calibration(path, faults)
    if T_lidar_camera is not None:
        poses = of_body(poses, T_lidar_camera, turn_world=True)
        source += " of the camera, moved to the lidar"
    found = Folder(
        format="kitti",
        sensor="lidar",
        kind="points",
        files=files,
        poses=poses,
        mount=IDENTITY,
        source=source,
        chosen="" if times else f"{1e9 / PERIOD_NS:g} sweeps a second",
        others=[poses_file, path / TIMES, path / CALIBRATION],
        read=_read_cloud,
    )
    return open_folder(path, found, options, faults)


def _read_cloud(path: Path, limits: Limits, faults: Faults) -> Beams:
    """Return the beams of a cloud.

    Raises:
        Broken: It is not made of whole points of four numbers, or of more than `MOST_CLOUD` bytes.
    """
    size = path.stat().st_size
    if size % POINT_BYTES or size > MOST_CLOUD:
        raise Broken(f"{path.name}: {size} bytes, expected {POINT_BYTES} for a point")
    numbers = np.fromfile(path, "<f4")
    width = _width(numbers)
    if width != POINT_BYTES // 4:
        raise Broken(f"{path.name}: {width} numbers a point, expected 4: x, y, z, intensity")
    points = np.ascontiguousarray(numbers.reshape(-1, width)[:, :3])
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
    return next((found for one in CLOUD_FOLDERS if (found := _by_number(path / one, "*.bin"))), [])


def _by_number(folder: Path, pattern: str) -> list[Path]:
    return sorted(folder.glob(pattern), key=lambda one: (len(one.name), one.name))


def _times(path: Path, faults: Faults) -> list[int]:
    """Return the stamps of the sweeps, ns; none without the file."""
    times: list[int] = []
    for words in rows(path / TIMES) if (path / TIMES).is_file() else ():
        try:
            times.append(nanoseconds(words[0]))
        except (ValueError, ArithmeticError):
            faults["line: not a time"] += 1
            times.append(times[-1] if times else 0)  # keeps the count; its sweep is out of order
    return times


def _calibration(path: Path, faults: Faults) -> Transform | None:
    """Return T_lidar_camera from the line `Tr:` (T_camera_lidar); None without the file."""
    if not (path / CALIBRATION).is_file():
        return None
    for words in rows(path / CALIBRATION):
        if words[0] in ("Tr:", "Tr_velo_to_cam:"):
            matrix = matrix_of(words[1:])
            given = stamped([0], [] if matrix is None else [matrix], faults) if matrix else None
            if given is not None and len(given.stamps_ns):
                return inverse(Transform(given.positions[0], given.quaternions[0]))
            break
    faults["calibration: none, the camera's axes alone are turned"] += 1
    return OPTICAL


# TUM RGB-D: Sturm et al., "A benchmark for the evaluation of RGB-D SLAM systems", 2012.

DEPTHS, TRUTH = "depth.txt", "groundtruth.txt"
TUM_UNITS = 5000.0
"""Units of a depth image in a metre."""

TUM_CAMERAS: dict[str, Intrinsics] = {
    "freiburg1": (517.3, 516.5, 318.6, 255.3),
    "freiburg2": (520.9, 521.0, 325.1, 249.7),
    "freiburg3": (535.4, 539.2, 320.1, 247.6),
    "": (525.0, 525.0, 319.5, 239.5),
}
"""Intrinsics of the benchmark's cameras by a part of the folder's name, and for any of them."""


def is_tum(path: Path) -> bool:
    """Return whether a folder has the two lists."""
    return (path / DEPTHS).is_file() and (path / TRUTH).is_file()


def open_tum(path: Path, options: RecordingOptions) -> Recording:
    """Open a sequence; the body is the camera, with x ahead and z up.

    Raises:
        InputError: It has no image or no pose.
    """
    faults: Faults = Counter()
    usual = next(one for name, one in TUM_CAMERAS.items() if name in path.name.lower())
    files, stamps, numbers = [], [], []
    for words in rows(path / DEPTHS):
        try:
            image = (path / words[1]).resolve()
            if not image.is_relative_to(path.resolve()):
                raise ValueError(image)
            files.append((nanoseconds(words[0]), image))
        except (ValueError, ArithmeticError, IndexError, OSError):
            faults["line: not an image"] += 1
    for words in rows(path / TRUTH):  # stamp, tx ty tz, qx qy qz qw of the optical frame
        try:
            row = [float(word) for word in words[1:8]]
            stamp = nanoseconds(words[0])
            if len(row) != 7:
                raise ValueError(words)
            stamps.append(stamp)
            numbers.append(row)
        except (ValueError, ArithmeticError):
            faults["line: not a pose"] += 1
    table = np.array(numbers, np.float64).reshape(-1, 7)
    quaternions = np.roll(table[:, 3:], 1, axis=1)
    poses = StampedPoses(np.array(stamps, np.int64), table[:, :3], quaternions)
    found = Folder(
        format="tum",
        sensor="depth",
        kind="depth",
        files=files,
        poses=of_body(poses, OPTICAL, turn_world=False),
        mount=OPTICAL,
        source=TRUTH,
        chosen=_in_words(options.intrinsics or usual),
        others=[path / DEPTHS, path / TRUTH],
        read=depth_reader(options, options.intrinsics or usual, TUM_UNITS),
    )
    return open_folder(path, found, options, faults)


def _in_words(intrinsics: Intrinsics) -> str:
    return f"intrinsics {','.join(f'{value:g}' for value in intrinsics)}"


# Folders of depth images with a pose file for each.

RATE = 30
"""Frames per second: the files have no stamps; this is the rate of a Kinect."""

FRAME_UNITS = 1000.0
FRAME_CAMERA: Intrinsics = (585.0, 585.0, 320.0, 240.0)
"""Intrinsics of the depth camera of 7-Scenes (Shotton et al., 2013)."""

INTRINSICS = ("camera-intrinsics.txt", "intrinsic/intrinsic_depth.txt", "intrinsics.txt")
"""Files with a matrix of intrinsics."""

LAYOUTS = (("", "*.depth.png", "{stem}.pose.txt"), ("depth", "*.png", "pose/{stem}.txt"))
"""Folder of the images, their names, and the name of the pose beside: 7-Scenes, ScanNet."""

MOST_MATRIX = 2**16


def is_frames(path: Path) -> bool:
    """Return whether a folder has an image with a pose."""
    return path.is_dir() and any(pose.is_file() for _, pose in _pairs(path)[:3])


def open_frames(path: Path, options: RecordingOptions) -> Recording:
    """Open a folder of frames; the body is the camera, with x ahead and z up.

    Where the poses are relative to some frame of a camera (7-Scenes), which is taken to have been
    level, the world is turned so that its z is up. In ScanNet it is.

    Raises:
        InputError: It has no image or no pose.
    """
    faults: Faults = Counter()
    pairs = _pairs(path)
    camera = next((path / name for name in INTRINSICS if (path / name).is_file()), None)
    intrinsics = options.intrinsics or _intrinsics(camera, faults) or FRAME_CAMERA
    files, stamps, numbers = [], [], []
    for place, (image, pose) in enumerate(pairs):
        number = re.findall(r"\d+", image.name)
        stamp = (int(number[0][:9]) if number else place) * 10**9 // RATE
        files.append((stamp, image))
        words = (
            [word for line in rows(pose, MOST_MATRIX) for word in line] if pose.is_file() else []
        )
        matrix = matrix_of(words)
        if matrix is None:
            faults["pose: no matrix"] += 1
        else:
            stamps.append(stamp)
            numbers.append(matrix)
    poses = stamped(stamps, numbers, faults)
    # Datasets do not say which way is up: the camera's own up is laid beside both, at all poses.
    up = rotate(poses.quaternions, np.array([0.0, -1.0, 0.0])).sum(axis=0)
    turned = bool(-up[1] >= up[2])
    found = Folder(
        format="frames",
        sensor="depth",
        kind="depth",
        files=files,
        poses=of_body(poses, OPTICAL, turn_world=turned),
        mount=OPTICAL,
        source="a matrix for each image",
        chosen=(
            f"{_in_words(intrinsics)}, {RATE} frames a second,"
            f" z up {'as the camera' if turned else 'in the poses'}"
        ),
        others=[*([camera] if camera else []), *(pose for _, pose in pairs)],
        read=depth_reader(options, intrinsics, FRAME_UNITS),
    )
    return open_folder(path, found, options, faults)


def _pairs(path: Path) -> list[tuple[Path, Path]]:
    """Return images with the names of their poses, in order of the numbers in their names."""
    for folder, pattern, named in LAYOUTS:
        if images := _by_number(path / folder, pattern):
            return [(one, path / named.format(stem=one.name.split(".")[0])) for one in images]
    return []


def _intrinsics(path: Path | None, faults: Faults) -> Intrinsics | None:
    """Return the intrinsics of a matrix (3, 3) or (4, 4); None if it is invalid."""
    if path is None:
        return None
    try:
        table = [[float(word) for word in words] for words in rows(path, MOST_MATRIX)]
        found = table[0][0], table[1][1], table[0][2], table[1][2]
        if usable(found):
            return found
    except (ValueError, IndexError):
        pass
    faults["intrinsics: no matrix"] += 1
    return None
