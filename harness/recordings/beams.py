"""Beams of sweeps: directions of planar scans, and ranges that say nothing sorted out."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.recordings.recording import Faults
from wayproof.maps.elementary import sines_cosines


class Limits(NamedTuple):
    """Limits of a sensor's ranges.

    Attributes:
        range_min: Returns below are none, m.
        range_max: Maximum range that the sensor can measure, m.
        cut: Returns beyond are cut off there: the beam was free up to it, m.
        beyond_is_none: Whether a range at or beyond `range_max` is the sensor's way to write that
            there was no return; else it is a fault.
    """

    range_min: float
    range_max: float
    cut: float
    beyond_is_none: bool


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
    """Sort out ranges (n,), m, that say nothing; count them.

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
