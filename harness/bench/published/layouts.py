"""Writers of recordings in the layouts of public datasets, from a recording of our simulation."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from wayproof.harness.recordings.depth import Intrinsics
from wayproof.harness.recordings.frames import RATE
from wayproof.harness.recordings.matrices import OPTICAL
from wayproof.harness.recordings.poses import compose, inverse
from wayproof.harness.recordings.recording import Recording
from wayproof.harness.recordings.types import IDENTITY, RecordedSweep, Transform
from wayproof.models.poses import rotation_matrices

EPOCH_S = 1_305_031_102
"""Stamp of the first pose of a TUM sequence, s: that of freiburg1_xyz."""

T_CAMERA_LIDAR = inverse(Transform(np.array([0.272, -0.004, -0.076]), OPTICAL.quaternion))
"""Place of the lidar in the left camera of KITTI, about that of sequence 00."""


class Camera(NamedTuple):
    """A pinhole camera.

    Attributes:
        width: Columns of pixels.
        height: Rows of pixels.
        intrinsics: fx, fy, cx, cy, pixels.
    """

    width: int
    height: int
    intrinsics: Intrinsics


Write = Callable[[Recording, Camera, Path], Path]
"""Writes a recording of one depth camera into a folder, and returns the path to open."""


def write_tum(recording: Recording, camera: Camera, folder: Path) -> Path:
    """Write a TUM RGB-D sequence: `depth.txt`, `groundtruth.txt`, 5000 units in a metre."""
    path = folder / "rgbd_dataset_of_ours"
    (path / "depth").mkdir(parents=True)
    images, poses = ["# depth maps"], ["# timestamp tx ty tz qx qy qz qw"]
    for sweep, pose in _placed(recording, OPTICAL):
        stamp = f"{EPOCH_S + sweep.time_ns // 10**9}.{sweep.time_ns % 10**9:09d}"
        _write_image(path / f"depth/{stamp}.png", sweep, camera, units=5000.0)
        images.append(f"{stamp} depth/{stamp}.png")
        w, x, y, z = pose.quaternion.tolist()
        numbers = [*pose.position.tolist(), x, y, z, w]
        poses.append(" ".join([stamp, *map(repr, numbers)]))
    (path / "depth.txt").write_text("\n".join(images) + "\n")
    (path / "groundtruth.txt").write_text("\n".join(poses) + "\n")
    return path


def write_seven_scenes(recording: Recording, camera: Camera, folder: Path) -> Path:
    """Write a sequence of 7-Scenes: `frame-000000.depth.png` and `.pose.txt` in one folder.

    The world has the axes of a level camera; the intrinsics lie beside, as in the copies of
    `tsdf-fusion`.
    """
    path = folder / "seq-01"
    path.mkdir(parents=True)
    for sweep, pose in _placed(recording, OPTICAL):
        stem = path / f"frame-{_frame_of(sweep):06d}"
        _write_image(Path(f"{stem}.depth.png"), sweep, camera, units=1000.0)
        _write_matrix(Path(f"{stem}.pose.txt"), compose(inverse(OPTICAL), pose))
    _write_intrinsics(path / "camera-intrinsics.txt", camera, 3)
    return path


def write_scannet(recording: Recording, camera: Camera, folder: Path) -> Path:
    """Write a scene of ScanNet as its exporter does: `depth/`, `pose/`, `intrinsic/`, z up."""
    path = folder / "scene0000_00"
    for name in ("depth", "pose", "intrinsic"):
        (path / name).mkdir(parents=True)
    for sweep, pose in _placed(recording, OPTICAL):
        number = _frame_of(sweep)
        _write_image(path / f"depth/{number}.png", sweep, camera, units=1000.0)
        _write_matrix(path / f"pose/{number}.txt", pose)
    _write_intrinsics(path / "intrinsic/intrinsic_depth.txt", camera, 4)
    return path


def write_kitti(recording: Recording, folder: Path) -> Path:
    """Write a sequence of the KITTI odometry benchmark, with the poses of its left camera.

    They are relative to that of a camera on a level lidar at the world's origin.
    """
    path = folder / "sequences/00"
    (path / "velodyne").mkdir(parents=True)
    (folder / "poses").mkdir()
    back = inverse(T_CAMERA_LIDAR)
    lines, times = [], []
    for number, (sweep, pose) in enumerate(_placed(recording, IDENTITY)):
        points = sweep.points if sweep.points is not None else np.empty((0, 3), np.float32)
        rows = np.zeros((len(points), 4), np.float32)
        rows[:, :3] = points
        rows.tofile(path / f"velodyne/{number:06d}.bin")
        camera = _matrix(compose(compose(T_CAMERA_LIDAR, pose), back))
        lines.append(_row(camera))
        times.append(f"{sweep.time_ns * 1e-9:.9f}")
    (folder / "poses/00.txt").write_text("\n".join(lines) + "\n")
    (path / "times.txt").write_text("\n".join(times) + "\n")
    calibration = f"P0: 1 0 0 0 0 1 0 0 0 0 1 0\nTr: {_row(_matrix(T_CAMERA_LIDAR))}\n"
    (path / "calib.txt").write_text(calibration)
    return path


DEPTH_LAYOUTS: dict[str, Write] = {
    "tum": write_tum,
    "7-scenes": write_seven_scenes,
    "scannet": write_scannet,
}
"""Name -> writer of sequences of depth images."""


def _placed(
    recording: Recording, T_sensor_axes: Transform
) -> Iterator[tuple[RecordedSweep, Transform]]:
    """Yield each sweep with the pose of its sensor at its time, in axes of another layout."""
    for sweep in recording.sweeps():
        positions, quaternions = recording.track.at(np.array([sweep.time_ns]))
        pose = compose(Transform(positions[0], quaternions[0]), sweep.T_body_sensor)
        yield sweep, compose(pose, T_sensor_axes)


def _frame_of(sweep: RecordedSweep) -> int:
    """Return the number of the frame at the time of a sweep, of 30 a second."""
    return round(sweep.time_ns * RATE * 1e-9)


def _matrix(pose: Transform) -> NDArray[np.float64]:
    """Return a pose as a matrix (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_matrices(pose.quaternion[None])[0]
    matrix[:3, 3] = pose.position
    return matrix


def _row(matrix: NDArray[np.float64]) -> str:
    """Return the first three rows of a matrix (4, 4) as one line, bit by bit."""
    return " ".join(map(repr, matrix[:3].ravel().tolist()))


def _write_matrix(path: Path, pose: Transform) -> None:
    path.write_text("\n".join(" ".join(map(repr, row)) for row in _matrix(pose).tolist()) + "\n")


def _write_image(path: Path, sweep: RecordedSweep, camera: Camera, units: float) -> None:
    """Write the depths of a sweep whose sensor looks along x, with z up; 0 without a return."""
    points = sweep.points if sweep.points is not None else np.empty((0, 3), np.float32)
    depth, across, down = points[:, 0].astype(np.float64), -points[:, 1], -points[:, 2]
    fx, fy, cx, cy = camera.intrinsics
    column = np.rint(fx * across / depth + cx).astype(np.int64)
    row = np.rint(fy * down / depth + cy).astype(np.int64)
    pixels = np.zeros((camera.height, camera.width), np.uint16)
    pixels[row, column] = np.rint(depth * units)
    Image.fromarray(pixels).save(path, compress_level=1)


def _write_intrinsics(path: Path, camera: Camera, size: int) -> None:
    fx, fy, cx, cy = camera.intrinsics
    matrix = np.eye(size)
    matrix[0, 0], matrix[0, 2], matrix[1, 1], matrix[1, 2] = fx, cx, fy, cy
    np.savetxt(path, matrix, fmt="%.17g")
