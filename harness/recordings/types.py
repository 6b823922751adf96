"""Sensors and sweeps of a recording, as they were recorded, in the sensor's frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.recordings.transform import Transform
from wayproof.harness.schema import wayproof_pb2 as pb

SensorKind = Literal["laser", "points", "depth"]
"""A planar laser scanner, point clouds, or a depth camera."""


@dataclass(frozen=True)
class ScanGrid:
    """The angles of a planar laser, as `sensor_msgs/LaserScan` describes them.

    Attributes:
        angle_min: Angle of the first beam from the x axis towards y, rad, a float32.
        angle_increment: Angle from one beam to the next, rad, a float32.
        beams: Number of beams of the scan.
        time_increment: Time from one beam to the next, s, a float32.
        places: (n,) int32 place on the grid of each beam of the sweep.
    """

    angle_min: float
    angle_increment: float
    beams: int
    time_increment: float
    places: NDArray[np.int32]


@dataclass(frozen=True)
class RecordedSensor:
    """One sensor of a recording.

    Attributes:
        name: Topic, without the slash before it, or message that its sweeps come from.
        frame: Frame of its beams.
        kind: Kind of the sensor.
        range_min: Minimum range, m, a float32.
        range_max: Maximum range, m, a float32; inf where the recording does not say.
        missing_returns_known: Whether a range of inf says that the beam was free up to
            `range_max`. Where it is false, no return may have been a fault as well, and space
            without a return is not known to be free.
        declared: Beam tables, mounting and range as in the log of the episode that was recorded, of
            a sensor that fires the same beams in every sweep; None for others.
        mount_is_fixed: Whether its mount is that of its first sweep throughout.
    """

    name: str
    frame: str
    kind: SensorKind
    range_min: float
    range_max: float
    missing_returns_known: bool
    declared: pb.SensorInfo | None = None
    mount_is_fixed: bool = True


OWN_UNKNOWN, OWN_FREE, OWN_CLOSED = 0, 1, 2
"""States of cells of a robot's own map: unknown, free, and where its centre may not be."""


class OwnMap(NamedTuple):
    """A map that the recorded robot itself had, in the frame of the poses.

    Attributes:
        time_ns: Its stamp, ns since the first pose of the recording.
        topic: Topic that it was on.
        resolution: Size of its cells, m.
        corner: x, y, m, and heading, rad, of the corner of its first cell.
        shape: Number of rows, along y, and of columns, along x.
        packed: States, a byte each, row by row, by zlib.
    """

    time_ns: int
    topic: str
    resolution: float
    corner: tuple[float, float, float]
    shape: tuple[int, int]
    packed: bytes


@dataclass(frozen=True)
class RecordedSweep:
    """One sweep of one sensor as it was recorded, in the sensor's frame.

    Attributes:
        time_ns: Stamp of the sweep, ns since the first pose of the recording.
        sensor: Name of the sensor.
        directions: (n, 3) float32 unit vectors.
        ranges: (n,) float32 m, above 0; inf where no return was measured, never NaN.
        beam_times_ns: (n,) int64 times of the beams after `time_ns`, ns, which may be negative;
            None if all were taken at once.
        T_body_sensor: The sensor's mount at that time.
        grid: Angles of a planar laser; None for others.
        points: (k, 3) float32 m, ends of the beams with a return, which come first, as they were
            recorded; None for a planar laser.
        measured: (beams,) uint16 mm of all beams of the tables that the sensor `declared`, as it
            measured them: 0 dropped, 65535 no return; None without tables.
    """

    time_ns: int
    sensor: str
    directions: NDArray[np.float32]
    ranges: NDArray[np.float32]
    beam_times_ns: NDArray[np.int64] | None
    T_body_sensor: Transform
    grid: ScanGrid | None = None
    points: NDArray[np.float32] | None = None
    measured: NDArray[np.uint16] | None = None
