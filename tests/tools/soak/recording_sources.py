"""Small sound recordings of every format, to be broken."""

from __future__ import annotations

import bz2
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import get_args

import numpy as np
from PIL import Image

from tests.tools.small_log import COMMITTED
from wayproof.harness.recordings.bags.building import Builder
from wayproof.harness.recordings.bags.messages import (
    CAMERA,
    CLOUD,
    IMAGE,
    ODOMETRY,
    SCAN,
    TRANSFORMS,
)
from wayproof.harness.recordings.bags.writing import BagKind, Stamped, encoding_of, write_bag
from wayproof.harness.recordings.transform import Transform
from wayproof.harness.recordings.types import RecordedSensor, RecordedSweep, ScanGrid

SWEEPS, BEAMS = 20, 60
PERIOD_NS = 100_000_000
UNTURNED = np.array([1.0, 0.0, 0.0, 0.0])

Source = Callable[[Path], Path]
"""Writes a recording into a folder and returns its path."""


def carmen(folder: Path) -> Path:
    """Write a log of laser scans."""
    lines = ["PARAM robot_front_laser_max 50 host 0", "PARAM robot_frontlaser_offset 0.1 host 0"]
    for k in range(SWEEPS):
        ranges = " ".join(f"{1.0 + 0.01 * (k + n):.2f}" for n in range(BEAMS))
        pose, stamp = f"{0.1 * k} 0 0", f"{100.0 + 0.1 * k}"
        laser = f"{0.1 * k + 0.1} 0 0"
        lines.append(f"FLASER {BEAMS} {ranges} {laser} {pose} {stamp} host {0.1 * k}")
        lines.append(f"ODOM {pose} 0 0 0 {stamp} host {0.1 * k}")
    path = folder / "log.clf"
    path.write_text("\n".join(lines) + "\n")
    return path


def packed_carmen(folder: Path) -> Path:
    """Write a CARMEN log, compressed."""
    plain = carmen(folder)
    path = folder / "log.clf.bz2"
    path.write_bytes(bz2.compress(plain.read_bytes()))
    plain.unlink()
    return path


def tum(folder: Path) -> Path:
    """Write a TUM RGB-D sequence."""
    path = folder / "tum"
    (path / "depth").mkdir(parents=True)
    images, poses = [], []
    for k in range(SWEEPS):
        Image.fromarray(_depths(k)).save(path / f"depth/{k}.png")
        images.append(f"{0.1 * k:.2f} depth/{k}.png")
        poses.append(f"{0.1 * k:.2f} {0.1 * k} 0 1 0 0 0 1")
    (path / "depth.txt").write_text("\n".join(images))
    (path / "groundtruth.txt").write_text("\n".join(poses))
    return path


def frames(folder: Path) -> Path:
    """Write a folder of depth images with matrices."""
    path = folder / "frames"
    path.mkdir()
    for k in range(SWEEPS):
        Image.fromarray(_depths(k)).save(path / f"frame-{k:06d}.depth.png")
        np.savetxt(path / f"frame-{k:06d}.pose.txt", _matrix(k))
    return path


def kitti(folder: Path) -> Path:
    """Write a folder of clouds with poses, times and a calibration."""
    path = folder / "kitti"
    (path / "velodyne").mkdir(parents=True)
    for k in range(SWEEPS):
        cloud = np.column_stack([_points(k), np.zeros(BEAMS)]).astype("<f4")
        cloud.tofile(path / f"velodyne/{k:06d}.bin")
    np.savetxt(path / "poses.txt", [_matrix(k)[:3].ravel() for k in range(SWEEPS)])
    np.savetxt(path / "times.txt", 0.1 * np.arange(SWEEPS))
    (path / "calib.txt").write_text("Tr: 0 -1 0 0 0 0 -1 0 1 0 0 0\n")
    return path


def episode(folder: Path) -> Path:
    """Copy the committed log of an episode."""
    path = folder / "episode.mcap"
    path.write_bytes(COMMITTED.read_bytes())
    return path


def _bag(folder: Path, kind: BagKind, what: str) -> Path:
    """Write a bag with one sensor as a file; of ROS 2, the storage in its folder."""
    out = folder / ("bag.bag" if kind == "ros1" else "bag")
    write_bag(_messages(Builder(encoding_of(kind)), what), out, kind)
    return out if kind == "ros1" else next(one for one in out.iterdir() if one.suffix != ".yaml")


SOURCES: dict[str, Source] = {
    "carmen": carmen,
    "carmen.bz2": packed_carmen,
    "tum": tum,
    "frames": frames,
    "kitti": kitti,
    "episode": episode,
    **{
        f"{what}s {kind}": partial(_bag, kind=kind, what=what)
        for what in ("scan", "cloud", "image")
        for kind in get_args(BagKind)
    },
}


def _messages(build: Builder, what: str) -> Iterator[Stamped]:
    start = 10**18
    mount = Transform(np.array([0.1, 0.0, 0.2]), UNTURNED)
    fixed = build.transforms(start, "base_link", "sensor", mount)
    yield Stamped(start, "/tf_static", TRANSFORMS[0], fixed)
    for k in range(SWEEPS):
        now = start + k * PERIOD_NS
        pose = Transform(np.array([0.1 * k, 0.0, 0.0]), UNTURNED)
        moved = build.transforms(now, "odom", "base_link", pose)
        yield Stamped(now, "/tf", TRANSFORMS[0], moved)
        odometry = build.odometry(now, "odom", "base_link", pose)
        yield Stamped(now, "/odom", ODOMETRY, odometry)
        if k + 1 < SWEEPS:  # the beams of the last one would be after the last pose
            yield from _sensor(build, what, now, k)


def _sensor(build: Builder, what: str, now: int, k: int) -> Iterator[Stamped]:
    if what == "scan":
        yield Stamped(now, "/scan", SCAN, build.scan(now, "sensor", *_scan(k)))
    elif what == "cloud":
        times = np.linspace(0, 5e7, BEAMS).astype(np.int64)
        cloud = build.cloud(now, "sensor", _points(k), times)
        yield Stamped(now, "/points", CLOUD, cloud)
    else:
        pixels = _depths(k)
        camera = _camera(build, now, pixels.shape)
        yield Stamped(now, "/depth/camera_info", CAMERA, camera)
        image = build.make(
            "sensor_msgs/Image",
            header=build.header(now, "sensor"),
            height=pixels.shape[0],
            width=pixels.shape[1],
            encoding="16UC1",
            is_bigendian=0,
            step=pixels.strides[0],
            data=pixels.view(np.uint8).reshape(-1),
        )
        yield Stamped(now, "/depth/image", IMAGE, image)


def _scan(k: int) -> tuple[RecordedSensor, RecordedSweep]:
    ranges = (1.0 + 0.01 * (k + np.arange(BEAMS))).astype(np.float32)
    sensor = RecordedSensor(
        "scan",
        frame="sensor",
        kind="laser",
        range_min=0.0,
        range_max=50.0,
        missing_returns_known=False,
    )
    grid = ScanGrid(
        angle_min=-1.5,
        angle_increment=0.05,
        beams=BEAMS,
        time_increment=0.0,
        places=np.arange(BEAMS, dtype=np.int32),
    )
    nothing = np.empty((0, 3), np.float32)
    pose = Transform(np.zeros(3), UNTURNED)
    return sensor, RecordedSweep(
        time_ns=0,
        sensor="scan",
        directions=nothing,
        ranges=ranges,
        beam_times_ns=None,
        T_body_sensor=pose,
        grid=grid,
    )


def _camera(build: Builder, now: int, shape: tuple[int, ...]) -> object:
    matrix = np.array([50.0, 0, shape[1] / 2, 0, 50.0, shape[0] / 2, 0, 0, 1])
    lens = {"D": np.zeros(5), "K": matrix, "R": np.eye(3).ravel(), "P": np.zeros(12)}
    roi = build.make(
        "sensor_msgs/RegionOfInterest",
        **{"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False},
    )
    return build.make(
        "sensor_msgs/CameraInfo",
        header=build.header(now, "sensor"),
        height=shape[0],
        width=shape[1],
        distortion_model="plumb_bob",
        binning_x=0,
        binning_y=0,
        roi=roi,
        **lens,
        **{name.lower(): value for name, value in lens.items()},
    )


def _points(k: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float32]]:  # (n, 3)
    angles = np.linspace(0.0, 6.0, BEAMS)
    rows = [2.0 * np.cos(angles) + 0.1 * k, 2.0 * np.sin(angles), 0.1 * angles]
    return np.column_stack(rows).astype(np.float32)


def _depths(k: int) -> np.ndarray[tuple[int, ...], np.dtype[np.uint16]]:  # (16, 24)
    return np.full((16, 24), 1000 + 10 * k, np.uint16)


def _matrix(k: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:  # (4, 4)
    matrix = np.eye(4)
    matrix[2, 3] = 0.1 * k
    return matrix
