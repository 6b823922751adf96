"""Clouds of Livox's drivers: `livox_ros_driver/CustomMsg`, and that of `livox_ros_driver2`."""

from __future__ import annotations

from typing import Any

import numpy as np

from wayproof.harness.recordings.bags.parts import Cloud, Vendor, stamp_of

TYPES = ("livox_ros_driver2/msg/CustomMsg", "livox_ros_driver/msg/CustomMsg")

POINT = (
    "uint32 offset_time\nfloat32 x\nfloat32 y\nfloat32 z\n"
    "uint8 reflectivity\nuint8 tag\nuint8 line\n"
)
CLOUD = (
    "std_msgs/Header header\nuint64 timebase\nuint32 point_num\nuint8 lidar_id\n"
    "uint8[3] rsvd\nCustomPoint[] points\n"
)


def read(message: Any) -> Cloud:
    """Return the points of a CustomMsg with their times."""
    rows = [(one.x, one.y, one.z) for one in message.points]
    points = np.array(rows, np.float32).reshape(-1, 3)
    # The driver sends a beam without return as a point at the sensor.
    met = points.any(axis=1)
    times = np.array([one.offset_time for one in message.points], np.uint32)[met]
    frame = message.header.frame_id
    return Cloud(points[met], times, "offset_time", stamp_of(message.header), frame)


VENDOR = Vendor(
    definitions={name.replace("Msg", "Point"): POINT for name in TYPES}
    | dict.fromkeys(TYPES, CLOUD),
    clouds=dict.fromkeys(TYPES, read),
)
