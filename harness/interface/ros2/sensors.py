"""Sweeps as ROS 2 messages: scans and clouds of lidars, images of depth cameras."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from wayproof.harness.interface.ros2.messages import (
    CameraInfo,
    Header,
    Image,
    LaserScan,
    Message,
    PointCloud2,
    PointField,
    RegionOfInterest,
    Time,
)
from wayproof.harness.interface.ros2.options import RANGES
from wayproof.harness.interface.types import Array, Sensor, Sweep, Task
from wayproof.models.sensors.beams import DROPPED, NO_RETURN

FLOAT32 = 7
"""`sensor_msgs/msg/PointField.FLOAT32`."""

WHOLE = RegionOfInterest(0, 0, 0, 0, False)
"""Region of an image: all of it."""

SCAN_ELEVATION = math.radians(2.0)
"""Most that a lidar's flattest row may be inclined to be published as a scan, rad; its ranges are
then 0.06 % too long in the plane at most."""


class Named(NamedTuple):
    """A message and the topic that it is for, as in `TOPICS` or below a sensor's name."""

    topic: str
    message: Message


@dataclass(frozen=True)
class Lidar:
    """Clouds of a lidar, and scans of its flattest row.

    Attributes:
        sensor: The lidar.
        prefix: Prefix of its topics; of the first lidar empty.
    """

    sensor: Sensor
    prefix: str

    @cached_property
    def row(self) -> int | None:
        """Index of the row that a scan is made of; none if there is no even, flat one."""
        table = self.sensor.beams.table
        if table.non_repetitive or table.rows.shape[1] != 2 or len(table.columns) < 2:
            return None
        row = int(np.argmin(np.abs(table.rows[:, 1])))
        steps = np.diff(self.azimuths)
        flat = abs(table.rows[row, 1]) <= math.sin(SCAN_ELEVATION)
        return row if flat and np.ptp(steps) < 1e-6 else None

    @cached_property
    def azimuths(self) -> Array:
        """Azimuth of each column, (c,) rad, without jumps by full turns."""
        columns = self.sensor.beams.table.columns
        azimuths: Array = np.unwrap(np.arctan2(columns[:, 1], columns[:, 0]))
        return azimuths

    def topics(self) -> dict[str, type[Message]]:
        """Return topics that it publishes, with their types."""
        topics: dict[str, type[Message]] = {f"{self.prefix}points": PointCloud2}
        if self.row is not None:
            topics[f"{self.prefix}scan"] = LaserScan
        if has_ranges(self.sensor):
            topics[self.ranges_topic] = Image
        return topics

    @property
    def ranges_topic(self) -> str:
        """Topic of its sweeps as they were measured."""
        return f"{self.prefix}points{RANGES}"

    def messages(self, sweep: Sweep, sequence: int, stamp: Time) -> list[Named]:
        """Return a sweep as a cloud, and as a scan where it has one."""
        header = Header(stamp, self.sensor.info.name)
        made = [Named(f"{self.prefix}points", self._cloud(sweep, sequence, header))]
        if self.row is not None:
            made.append(Named(f"{self.prefix}scan", self._scan(sweep, header)))
        return made

    def _cloud(self, sweep: Sweep, sequence: int, header: Header) -> PointCloud2:
        """Build the cloud of returns, in the sensor's frame at the time of each."""
        returned = (sweep.ranges_mm != DROPPED) & (sweep.ranges_mm != NO_RETURN)
        beams = self.sensor.directions(sequence)[returned]
        ranges = sweep.ranges_mm[returned] * 1e-3
        points = (ranges[:, None] * beams).astype("<f4")
        size = points.dtype.itemsize
        return PointCloud2(
            header=header,
            height=1,
            width=len(points),
            fields=[PointField(name, size * i, FLOAT32, 1) for i, name in enumerate("xyz")],
            is_bigendian=False,
            point_step=3 * size,
            row_step=3 * size * len(points),
            data=np.frombuffer(points.tobytes(), np.uint8),
            is_dense=True,
        )

    def _scan(self, sweep: Sweep, header: Header) -> LaserScan:
        """Encode one row as a scan: infinity without return, NaN without information (REP 117)."""
        info, azimuths = self.sensor.info, self.azimuths
        ranges = sweep.ranges_m.reshape(-1, len(azimuths))[self.row].astype(np.float32)
        if azimuths[0] > azimuths[-1]:
            azimuths, ranges = azimuths[::-1], ranges[::-1]
        step = float(azimuths[-1] - azimuths[0]) / (len(azimuths) - 1)
        rolling = self.sensor.beams.table.scan_poses > 1
        return LaserScan(
            header=header,
            angle_min=float(azimuths[0]),
            angle_max=float(azimuths[-1]),
            angle_increment=step,
            time_increment=1.0 / (info.rate_hz * len(azimuths)) if rolling else 0.0,
            scan_time=1.0 / info.rate_hz,
            range_min=0.0,
            range_max=info.range_m,
            ranges=ranges,
            intensities=np.zeros(0, np.float32),
        )


@dataclass(frozen=True)
class DepthCamera:
    """Depth images of a camera, and its calibration.

    Attributes:
        sensor: The camera.
        prefix: Prefix of its topics.
    """

    sensor: Sensor
    prefix: str

    def topics(self) -> dict[str, type[Message]]:
        """Return topics that it publishes, with their types."""
        topics: dict[str, type[Message]] = {f"{self.prefix}image": Image}
        topics[f"{self.prefix}camera_info"] = CameraInfo
        if has_ranges(self.sensor):
            topics[self.ranges_topic] = Image
        return topics

    @property
    def ranges_topic(self) -> str:
        """Topic of its sweeps as they were measured."""
        return f"{self.prefix}image{RANGES}"

    def messages(self, sweep: Sweep, sequence: int, stamp: Time) -> list[Named]:
        """Return a sweep as an image, 32FC1 in metres, and the calibration with its stamp."""
        header = Header(stamp, optical_frame(self.sensor))
        image = Named(f"{self.prefix}image", self._image(sweep, header))
        return [image, Named(f"{self.prefix}camera_info", self._info(header))]

    def _image(self, sweep: Sweep, header: Header) -> Image:
        """Encode depths along the axis: infinity beyond range, NaN if unknown (REP 118)."""
        table = self.sensor.beams.table
        depth = sweep.ranges_m
        if table.measures == "range":
            depth = depth * self.sensor.directions()[:, 0]
        height, width = len(table.rows), len(table.columns)
        data = np.frombuffer(depth.astype("<f4").tobytes(), np.uint8)
        return Image(header, height, width, "32FC1", 0, 4 * width, data)

    def _info(self, header: Header) -> CameraInfo:
        """Describe a pinhole without distortion, whose pixels' centres have the table's slopes."""
        table = self.sensor.beams.table
        fx, cx = _pinhole(table.columns[:, 0])
        fy, cy = _pinhole(table.rows[:, 0])
        return CameraInfo(
            header=header,
            height=len(table.rows),
            width=len(table.columns),
            distortion_model="plumb_bob",
            d=np.zeros(5),
            k=np.array([fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
            r=np.eye(3).ravel(),
            p=np.array([fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]),
            binning_x=0,
            binning_y=0,
            roi=WHOLE,
        )


@dataclass(frozen=True)
class Rangefinder:
    """Ranges of a rangefinder, for recorders.

    Attributes:
        sensor: The rangefinder.
        prefix: Prefix of its topics.
    """

    sensor: Sensor
    prefix: str

    def topics(self) -> dict[str, type[Message]]:
        """Return topics that it publishes, with their types."""
        return {self.ranges_topic: Image}

    @property
    def ranges_topic(self) -> str:
        """Topic of its sweeps as they were measured."""
        return f"{self.prefix.rstrip('/')}{RANGES}"

    def messages(self, sweep: Sweep, sequence: int, stamp: Time) -> list[Named]:
        """Return no messages but its ranges."""
        return []


Publication = Lidar | DepthCamera | Rangefinder


def publications_of(task: Task) -> dict[str, Publication]:
    """Return the publication of each sensor by its name."""
    found: dict[str, Publication] = {}
    for name, sensor in task.sensors.items():
        kind: type[Publication] | None = KINDS.get(sensor.info.kind)
        if kind is None:
            continue
        first = not any(isinstance(one, kind) for one in found.values())
        prefix = FIRST[kind] if first and kind in FIRST else f"{name}/"
        found[name] = kind(sensor, prefix)
    return found


KINDS: dict[str, type[Publication]] = {
    "lidar": Lidar,
    "depth_camera": DepthCamera,
    "rangefinder": Rangefinder,
}
FIRST: dict[type[Publication], str] = {Lidar: "", DepthCamera: "depth/"}
"""Prefix of the topics of the first sensor of a kind."""


def has_ranges(sensor: Sensor) -> bool:
    """Return whether a sensor's sweeps are images of ranges: it fires the same beams always."""
    return sensor.beams.table.order == "grid"


def ranges_image(sensor: Sensor, sweep: Sweep, stamp: Time) -> Image:
    """Return a sweep as measured, mm, 16UC1: 0 dropped, 65535 no return; rows by columns of beams.

    With the beam tables of the topic `/task` it is all that a map takes of the sweep.
    """
    table = sensor.beams.table
    rows, columns = len(table.rows), len(table.columns)
    data = np.frombuffer(sweep.ranges_mm.astype("<u2").tobytes(), np.uint8)
    return Image(Header(stamp, sensor.info.name), rows, columns, "16UC1", 0, 2 * columns, data)


def optical_frame(sensor: Sensor) -> str:
    """Return the frame of a camera's images: x right, y down, z forward."""
    return f"{sensor.info.name}_optical"


def _pinhole(slopes: Array) -> tuple[float, float]:
    """Return the focal length and principal point, pixels, of evenly falling slopes (n,)."""
    if len(slopes) < 2:
        return 1.0, 0.0
    focal = (len(slopes) - 1) / float(slopes[0] - slopes[-1])
    return focal, focal * float(slopes[0])
