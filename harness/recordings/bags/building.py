"""Messages of ROS built from a recording's parts, for ROS 1 and ROS 2."""

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


class Builder:
    """Builds messages of one version of ROS, by the classes of `rosbags`."""

    def __init__(self, encoding: str) -> None:
        """Take the definitions of ROS 1 (`ros1`) or ROS 2 (`cdr`)."""
        self.store = typestore(encoding)

    def make(self, name: str, /, **fields: Any) -> Any:  # a class of rosbags
        """Build a message; fields that this version of ROS does not have are left out."""
        package, kind = name.split("/")
        message: Any = self.store.types[f"{package}/msg/{kind}"]
        known = message.__dataclass_fields__
        return message(**{key: value for key, value in fields.items() if key in known})

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
        return self.make("std_msgs/Header", seq=0, stamp=self.time(stamp_ns), frame_id=frame)

    def pose(self, transform: Transform) -> Any:
        """Build a pose."""
        x, y, z = transform.position.tolist()
        return self.make(
            "geometry_msgs/Pose",
            position=self.make("geometry_msgs/Point", x=x, y=y, z=z),
            orientation=self._quaternion(transform),
        )

    def transforms(self, stamp_ns: int, parent: str, child: str, transform: Transform) -> Any:
        """Build a TFMessage of one transform."""
        x, y, z = transform.position.tolist()
        one = self.make(
            "geometry_msgs/TransformStamped",
            header=self.header(stamp_ns, parent),
            child_frame_id=child,
            transform=self.make(
                "geometry_msgs/Transform",
                translation=self.make("geometry_msgs/Vector3", x=x, y=y, z=z),
                rotation=self._quaternion(transform),
            ),
        )
        return self.make("tf2_msgs/TFMessage", transforms=[one])

    def odometry(self, stamp_ns: int, parent: str, child: str, transform: Transform) -> Any:
        """Build an Odometry whose twist and covariances are not known (0, as ROS has it)."""
        zero = self.make("geometry_msgs/Vector3", x=0.0, y=0.0, z=0.0)
        still = self.make("geometry_msgs/Twist", linear=zero, angular=zero)
        covariance = np.zeros(36)
        return self.make(
            "nav_msgs/Odometry",
            header=self.header(stamp_ns, parent),
            child_frame_id=child,
            pose=self.make(
                "geometry_msgs/PoseWithCovariance",
                pose=self.pose(transform),
                covariance=covariance,
            ),
            twist=self.make(
                "geometry_msgs/TwistWithCovariance", twist=still, covariance=covariance
            ),
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
            scan_time=0.0,
            range_min=sensor.range_min,
            range_max=sensor.range_max,
            ranges=ranges,
            intensities=np.empty(0, np.float32),
        )

    def limits(self, stamp_ns: int, frame: str, sensor: RecordedSensor) -> Any:
        """Build a Range with a sensor's limits; it measures nothing (inf)."""
        return self.make(
            "sensor_msgs/Range",
            header=self.header(stamp_ns, frame),
            radiation_type=1,
            field_of_view=0.0,
            min_range=sensor.range_min,
            max_range=sensor.range_max,
            range=float("inf"),
            variance=0.0,
        )

    def cloud(
        self,
        stamp_ns: int,
        frame: str,
        points: NDArray[np.float32],
        times_ns: NDArray[np.int64] | None,
    ) -> Any:
        """Build a PointCloud2 of points (n, 3), m, with the time of each, ns, if they have some."""
        columns: dict[str, NDArray[Any]] = {
            name: points[:, axis] for axis, name in enumerate("xyz")
        }
        if times_ns is not None:
            columns[OWN_TIME] = times_ns.astype(np.uint32)
        kinds = np.dtype([(name, column.dtype) for name, column in columns.items()])
        rows = np.empty(len(points), kinds)
        numbers = {f"{np.dtype(text)}": number for number, text in TYPES.items()}
        fields = []
        for name, column in columns.items():
            rows[name] = column
            fields.append(
                self.make(
                    "sensor_msgs/PointField",
                    name=name,
                    offset=kinds.fields[name][1] if kinds.fields else 0,
                    datatype=numbers[f"{column.dtype}"],
                    count=1,
                )
            )
        return self.make(
            "sensor_msgs/PointCloud2",
            header=self.header(stamp_ns, frame),
            height=1,
            width=len(points),
            fields=fields,
            is_bigendian=False,
            point_step=kinds.itemsize,
            row_step=kinds.itemsize * len(points),
            data=rows.view(np.uint8).reshape(-1),
            is_dense=True,
        )

    def _quaternion(self, transform: Transform) -> Any:
        w, x, y, z = transform.quaternion.tolist()
        return self.make("geometry_msgs/Quaternion", x=x, y=y, z=z, w=w)
