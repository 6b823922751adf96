"""Errors of the ranges of a sweep, as the sweep itself shows them."""

from __future__ import annotations

from wayproof.harness.inputs import Beams, WorldSweep
from wayproof.maps import range_image
from wayproof.maps.sweep import Ranges
from wayproof.models.sensors.beams import NO_RETURN

SMALLEST = 0.06
"""Width of the smallest things that must not be taken for rain, m: farther away than a range at
which beams are as far apart, one of them may meet a thing alone."""

LEAST_STEP = 1e-4
"""Least distance of neighbouring beams at 1 m that is looked at, m; a table may repeat a column."""


def without_lost_echoes(placed: WorldSweep, beams: Beams) -> WorldSweep:
    """Return a sweep without the beams that lost their echo: no return between returns.

    A sensor that reports no return as free space would clear what those beams met.

    Args:
        placed: The sweep in the world frame.
        beams: Its sensor; only a grid has neighbouring beams.
    """
    if not beams.is_image or not (placed.ranges_mm == NO_RETURN).any():
        return placed
    lost = range_image.lost_echoes(_image(placed.ranges_mm, beams), beams.table.closed)
    return placed.without(lost.ravel())


def without_false_returns(placed: WorldSweep, beams: Beams, deviation: float) -> WorldSweep:
    """Return a sweep without the returns of rain, snow or dust: no evidence along those beams.

    Args:
        placed: The sweep in the world frame.
        beams: Its sensor; only a grid has neighbouring beams.
        deviation: Standard deviation of the ranges, m.
    """
    if not beams.is_image:
        return placed
    false = range_image.false_returns(
        _image(placed.ranges_mm, beams),
        beams.table.closed,
        farthest_m=SMALLEST / max(beams.column_step, LEAST_STEP),
        deviation_m=deviation,
    )
    return placed if false is None else placed.without(false.ravel())


def range_deviation(placed: WorldSweep, beams: Beams) -> float:
    """Estimate the standard deviation of the ranges of a sweep, m; 0 where it is no image."""
    if not beams.is_image:
        return 0.0
    return range_image.range_deviation(_image(placed.ranges_mm, beams)) or 0.0


def _image(ranges_mm: Ranges, beams: Beams) -> Ranges:
    image: Ranges = ranges_mm.reshape(len(beams.table.rows), len(beams.table.columns))
    return image
