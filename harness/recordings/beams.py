"""Beams of sweeps: directions of planar scans, and removal of ranges without information."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.inputs import Beams as LoggedBeams
from wayproof.harness.recordings.options import Faults
from wayproof.harness.recordings.types import ScanGrid
from wayproof.maps.elementary import sines_cosines
from wayproof.models.sensors import beams as tables


class Limits(NamedTuple):
    """Limits of a sensor's ranges.

    Attributes:
        range_min: Returns below are none, m.
        range_max: Maximum range that the sensor can measure, m.
        cut: Returns beyond count as none, m: what a beam without return says depends on the sensor.
        beyond_is_none: Whether a range at or beyond `range_max` is the sensor's way to write that
            there was no return; else it is a fault.
    """

    range_min: float
    range_max: float
    cut: float
    beyond_is_none: bool


class Silent(NamedTuple):
    """Beams without return.

    Attributes:
        directions: (m, 3) unit vectors.
        times_ns: (m,) after the stamp, ns; None if all were taken at it.
    """

    directions: NDArray[np.float32]
    times_ns: NDArray[np.int64] | None = None


FARTHEST = 1e5
"""Greatest range where a recording states none, m."""


class Beams(NamedTuple):
    """Beams of one sweep, those with a return first but for a planar laser.

    Attributes:
        directions: (n, 3) unit vectors.
        ranges: (n,) m, inf without a return.
        times_ns: (n,) after the stamp, ns; None if all were taken at once.
        grid: Angles of a planar laser.
        points: (k, 3) m, ends of the beams with a return.
        measured: (b,) mm as of `RecordedSweep`.
    """

    directions: NDArray[np.float32]
    ranges: NDArray[np.float32]
    times_ns: NDArray[np.int64] | None = None
    grid: ScanGrid | None = None
    points: NDArray[np.float32] | None = None
    measured: NDArray[np.uint16] | None = None


def from_first_beam(beams: Beams) -> tuple[int, NDArray[np.int64] | None]:
    """Return the time of the first beam after the stamp, 0 or less, and all times after that, ns.

    A stamp may be that of the end of a sweep; a sweep begins with its first beam.
    """
    times = beams.times_ns
    if times is None or len(times) == 0:
        return 0, None
    early = min(int(times.min()), 0)
    return early, times - early if early else times


def float32(value: float) -> float:
    """Return the nearest number of 32 bits, as messages of ROS hold it."""
    with np.errstate(over="ignore"):
        return float(np.float32(value))


@lru_cache(maxsize=16)
def scan_directions(
    angle_min: float, angle_increment: float, count: int
) -> NDArray[np.float32]:  # (count, 3)
    """Return unit vectors of the beams of a planar scan, x forward, y to the left.

    The angles are the float32 numbers of a `sensor_msgs/LaserScan`, and the beams the same bits
    whatever format they come from.
    """
    angles = float(angle_min) + np.arange(count, dtype=np.float64) * float(angle_increment)
    sines, cosines = sines_cosines(angles)
    directions = np.zeros((count, 3), np.float32)
    directions[:, 0], directions[:, 1] = cosines, sines
    directions.setflags(write=False)
    return directions


def measured(
    ranges: NDArray[np.float32], limits: Limits, faults: Faults
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Drop ranges (n,), m, without information, and count them.

    Returns:
        Ranges (n,) with inf where nothing was met up to the limit, and whether each is known.
    """
    no_number = np.isnan(ranges)
    none = ranges == np.inf
    with np.errstate(invalid="ignore"):
        short = (ranges < limits.range_min) | (ranges <= 0.0)
        long = ~none & (ranges >= limits.range_max)
        cut = ranges > limits.cut
    if limits.beyond_is_none:
        none = none | long
    else:
        long &= ranges > limits.range_max
        faults["range: beyond the maximum"] += int(long.sum())
    faults["range: not a number"] += int(no_number.sum())
    faults["range: below the minimum"] += int(short.sum())
    known = ~(no_number | short)
    if not limits.beyond_is_none:
        known &= ~long
    return np.where(none | cut, np.float32(np.inf), ranges), known


def scan_beams(
    angles: tuple[float, float],
    written: NDArray[np.float32],
    limits: Limits,
    faults: Faults,
    time_increment_s: float = 0.0,
) -> Beams:
    """Return the beams of a planar scan of ranges (n,), m, whose readings are known.

    Args:
        angles: Angle of the first beam, and from one to the next, rad, float32.
        written: Ranges as they were recorded.
        limits: Limits of the ranges.
        faults: Counts readings that say nothing.
        time_increment_s: Time from one beam to the next, s, float32.
    """
    ranges, known = measured(written, limits, faults)
    places = np.flatnonzero(known).astype(np.int32)
    times_ns = None
    if time_increment_s != 0.0:
        times_ns = np.rint(places * (time_increment_s * 1e9)).astype(np.int64)
    return Beams(
        directions=scan_directions(*angles, len(written))[places],
        ranges=ranges[places],
        times_ns=times_ns,
        grid=ScanGrid(*angles, len(written), time_increment_s, places),
    )


def point_beams(
    points: NDArray[np.float32],
    times_ns: NDArray[np.int64] | None,
    limits: Limits,
    faults: Faults,
    silent: Silent | None = None,
) -> Beams:
    """Return the beams that end at points (n, 3), m, in the sensor's frame.

    Args:
        points: Ends of the beams, finite.
        times_ns: (n,) after the stamp, ns.
        limits: Limits of the ranges.
        faults: Counts points that say nothing.
        silent: Beams without return.
    """
    x, y, z = (points[:, axis].astype(np.float64) for axis in range(3))
    lengths = np.sqrt(x * x + y * y + z * z)
    # A length that overflowed to inf would count as a beam without return.
    ranges, known = measured(np.minimum(lengths, 1e9).astype(np.float32), limits, faults)
    met = known & (ranges < np.inf)
    none = known & ~met
    order = np.concatenate([np.flatnonzero(met), np.flatnonzero(none)])
    directions = (points[order] / lengths[order, None]).astype(np.float32)
    ranges = ranges[order]
    if times_ns is not None:
        times_ns = times_ns[order]
    if silent is not None and len(silent.directions):
        count = len(silent.directions)
        directions = np.concatenate([directions, silent.directions])
        ranges = np.concatenate([ranges, np.full(count, np.inf, np.float32)])
        if times_ns is not None:
            at_stamp = np.zeros(count, np.int64)
            more = at_stamp if silent.times_ns is None else silent.times_ns
            times_ns = np.concatenate([times_ns, more])
    return Beams(directions, ranges, times_ns, points=points[met])


def measured_beams(
    logged: LoggedBeams,
    ranges_mm: NDArray[np.uint16],
    sequence: int,
    range_max: float,
    faults: Faults,
) -> Beams:
    """Return the beams of a sensor with tables that say something, by its ranges (n,), mm.

    Args:
        logged: The sensor's beams.
        ranges_mm: As it measured them: `DROPPED` and `NO_RETURN` have their meanings.
        sequence: Number of the sweep.
        range_max: Longest range that counts, m.
        faults: Counts readings that say nothing.

    Raises:
        InputError: There are more or fewer ranges than beams.
    """
    table = logged.table
    unit = tables.directions(table, sequence)
    if len(ranges_mm) != len(unit):
        raise InputError(f"a sweep of {len(ranges_mm)} beams, expected {len(unit)}")
    along = tables.ray_ranges(table, unit, ranges_mm)
    silent = along == tables.NO_RETURN
    met = ~silent & (along != tables.DROPPED)
    times = None
    if table.scan_poses > 1:
        times = tables.pose_offsets(table, round(1e9 / logged.rate))[tables.pose_indices(table)]
    points = (unit[met] * (along[met, None] / tables.MILLIMETRES)).astype(np.float32)
    limits = Limits(0.0, FARTHEST, range_max, beyond_is_none=False)
    none = Silent(unit[silent].astype(np.float32), None if times is None else times[silent])
    listed = point_beams(points, None if times is None else times[met], limits, faults, none)
    return listed._replace(measured=ranges_mm)
