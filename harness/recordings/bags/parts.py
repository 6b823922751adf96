"""What is read of the messages of a bag, and who reads those of a vendor."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.recordings.transform import Transform


class Cloud(NamedTuple):
    """The fields of a cloud that are used.

    Attributes:
        points: (n, 3) m.
        times: (n,) in the units of the field; None without one.
        time_field: Name of that field.
        stamp_ns: Stamp of the cloud, ns.
        frame: Frame of the points.
        is_ns: Whether the times are nanoseconds since the stamp, by the definition of the message.
    """

    points: NDArray[np.float32]
    times: NDArray[Any] | None  # of any type of number
    time_field: str
    stamp_ns: int
    frame: str
    is_ns: bool = False


class StampedTransform(NamedTuple):
    """A pose of a message.

    Attributes:
        stamp_ns: Stamp of its header, ns.
        parent: Frame in which it is given.
        child: Frame whose pose it is; empty where the message does not say.
        numbers: Position x, y, z, m, and quaternion w, x, y, z.
        resets: Number of jumps of the estimator so far; 0 where the message does not count them.
    """

    stamp_ns: int
    parent: str
    child: str
    numbers: tuple[float, float, float, float, float, float, float]
    resets: int = 0


class Grid(NamedTuple):
    """A costmap of the robot.

    Attributes:
        stamp_ns: Its stamp, ns.
        frame: Frame in which it lies.
        resolution: Size of its cells, m.
        T_frame_corner: Its origin: the corner of the first cell; rows along y, columns along x.
        states: (rows, columns) `OWN_UNKNOWN`, `OWN_FREE` or `OWN_CLOSED`.
    """

    stamp_ns: int
    frame: str
    resolution: float
    T_frame_corner: Transform
    states: NDArray[np.uint8]


class Patch(NamedTuple):
    """New states (rows, columns) of a part of a costmap, from column x and row y on."""

    stamp_ns: int
    x: int
    y: int
    states: NDArray[np.uint8]


class Vendor(NamedTuple):
    """Messages beside those of `rosbags`.

    Attributes:
        definitions: Definitions by type, for `rosbags`.
        clouds: Readers of points by type.
        poses: Readers of poses by type.
        grids: Readers of the robot's own maps by type.
        decoders: Decoders of the types that `rosbags` does not decode: from the bytes of a message.
    """

    definitions: Mapping[str, str] = {}
    clouds: Mapping[str, Callable[[Any], Cloud]] = {}
    poses: Mapping[str, Callable[[Any], StampedTransform]] = {}
    grids: Mapping[str, Callable[[Any], Grid | Patch]] = {}
    decoders: Mapping[str, Callable[[bytes], Any]] = {}


def stamp_of(header: Any) -> int:  # of a class of rosbags
    """Return the stamp of a header, ns."""
    return int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec)


def frame_name(name: str) -> str:
    """Return a frame's name without the slash that ROS 1 wrote before it."""
    return name.lstrip("/")
