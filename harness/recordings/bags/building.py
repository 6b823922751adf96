"""Messages of ROS built from values, and from a recording's parts, for ROS 1 and ROS 2."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.recordings.bags.clouds import OWN_TIME, TYPES
from wayproof.harness.recordings.bags.messages import typestore
from wayproof.harness.recordings.transform import Transform
from wayproof.harness.recordings.types import RecordedSensor, RecordedSweep

MOST_SECONDS = 2**31 - 1
"""Greatest seconds of a stamp of ROS 2."""

NANOSECONDS = 10**9

BASE, NAME, ARRAY, SEQUENCE = range(1, 5)
"""Kinds of fields of `rosbags`: a number or text, a message, so many of these, any number of them.
"""


class Builder:
    """Builds messages of one version of ROS, by the classes of `rosbags`."""

    def __init__(self, encoding: str) -> None:
        """Take the definitions of ROS 1 (`ros1`) or ROS 2 (`cdr`)."""
        self.store = typestore(encoding)

    def make(self, kind: str, /, **values: Any) -> Any:  # a class of rosbags
        """Build a message of a type like `nav_msgs/Odometry`.

        A value may be a dictionary of the values of a message; what is not given is 0, empty or
        false. Values that this version of ROS does not have are left out.
        """
        name = kind.replace("/", "/msg/")
        fields = self.store.get_msgdef(name).fields
        made = {field: self._value(values.get(field), *node) for field, node in fields}
        return self.store.types[name](**made)

    def _value(self, value: Any, node: int, about: Any) -> Any:
        """Return a value of a kind of field, by the definitions of `rosbags`."""
        if node == NAME and (value is None or isinstance(value, dict)):
            return self.make(about.replace("/msg/", "/"), **(value or {}))
        if node == BASE and value is None:
            return {"string": "", "bool": False}.get(about[0], 0)
        if node in (ARRAY, SEQUENCE):
            (inner, of), count = about
            if inner == NAME:
                return [self._value(one, inner, of) for one in value or [None] * count]
            if value is None:
                return np.zeros(count, of[0])
        return value

    def time(self, stamp_ns: int) -> Any:
        """Build a time.

        Raises:
            InputError: It is before the epoch or beyond 2038, which ROS cannot write.
        """
        seconds, fraction = divmod(stamp_ns, NANOSECONDS)
        if not 0 <= seconds <= MOST_SECONDS:
            raise InputError(f"stamp of {seconds} s, expected 0 to {MOST_SECONDS} for ROS")
        return self.make("builtin_interfaces/Time", sec=seconds, nanosec=fraction)

    def header(self, stamp_ns: int, frame: str) -> Any:
        """Build a header."""
        return self.make("std_msgs/Header", stamp=self.time(stamp_ns), frame_id=frame)

    def transforms(self, stamp_ns: int, parent: str, child: str, transform: Transform) -> Any:
        """Build a TFMessage of one transform."""
        position, turn = pose_values(transform)
        one = {
            "header": self.header(stamp_ns, parent),
            "child_frame_id": child,
            "transform": {"translation": position, "rotation": turn},
        }
        return self.make("tf2_msgs/TFMessage", transforms=[one])

    def odometry(self, stamp_ns: int, parent: str, child: str, transform: Transform) -> Any:
        """Build an Odometry whose twist and covariances are not known (0, as ROS has it)."""
        position, turn = pose_values(transform)
        return self.make(
            "nav_msgs/Odometry",
            header=self.header(stamp_ns, parent),
            child_frame_id=child,
            pose={"pose": {"position": position, "orientation": turn}},
        )

    def scan(self, stamp_ns: int, frame: str, sensor: RecordedSensor, sweep: RecordedSweep) -> Any:
        """Build a LaserScan: inf without a return, NaN where nothing is known."""
        grid = sweep.grid
        assert grid is not None
        ranges = np.full(grid.beams, np.nan, np.float32)
        ranges[grid.places] = sweep.ranges
        return self.make(
            "sensor_msgs/LaserScan",
            header=self.header(stamp_ns, frame),
            angle_min=grid.angle_min,
            angle_max=grid.angle_min + (grid.beams - 1) * grid.angle_increment,
            angle_increment=grid.angle_increment,
            time_increment=grid.time_increment,
            range_min=sensor.range_min,
            range_max=sensor.range_max,
            ranges=ranges,
        )

    def limits(self, stamp_ns: int, frame: str, sensor: RecordedSensor) -> Any:
        """Build a Range with a sensor's limits; it measures nothing (inf)."""
        return self.make(
            "sensor_msgs/Range",
            header=self.header(stamp_ns, frame),
            radiation_type=1,
            min_range=sensor.range_min,
            max_range=sensor.range_max,
            range=float("inf"),
        )

    def cloud(
        self,
        stamp_ns: int,
        frame: str,
        points: NDArray[np.float32],
        times_ns: NDArray[np.int64] | None,
    ) -> Any:
        """Build a PointCloud2 of points (n, 3), m, with the time of each, ns, if they have some."""
        kinds = [("x", "f4"), ("y", "f4"), ("z", "f4")]
        kinds += [(OWN_TIME, "u4")] if times_ns is not None else []
        rows = np.empty(len(points), kinds)
        rows["x"], rows["y"], rows["z"] = points.T
        if times_ns is not None:
            rows[OWN_TIME] = times_ns
        codes = {text: number for number, text in TYPES.items()}
        fields = [
            {"name": name, "offset": 4 * k, "datatype": codes[kind], "count": 1}
            for k, (name, kind) in enumerate(kinds)
        ]
        return self.make(
            "sensor_msgs/PointCloud2",
            header=self.header(stamp_ns, frame),
            height=1,
            width=len(points),
            fields=fields,
            point_step=rows.itemsize,
            row_step=rows.nbytes,
            data=rows.view(np.uint8).reshape(-1),
            is_dense=True,
        )


def pose_values(transform: Transform) -> tuple[dict[str, float], dict[str, float]]:
    """Return position and orientation of a pose as values of messages."""
    x, y, z = transform.position.tolist()
    a, b, c, d = transform.quaternion.tolist()
    return {"x": x, "y": y, "z": z}, {"x": b, "y": c, "z": d, "w": a}
