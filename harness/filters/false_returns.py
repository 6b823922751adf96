"""Returns of rain, snow or dust."""

from __future__ import annotations

from wayproof.harness.filters.filter import Filter, Origin, image_of
from wayproof.harness.inputs import WorldSweep
from wayproof.maps import range_image

SMALLEST = 0.06
"""Width of the smallest things that must not be taken for rain, m: farther away than a range at
which beams are as far apart, one of them may meet a thing alone."""

LEAST_STEP = 1e-4
"""Least distance of neighbouring beams at 1 m that is looked at, m; a table may repeat a column."""


class FalseReturns(Filter):
    """Drops the returns of what is in the air: no evidence along those beams."""

    def __call__(self, placed: WorldSweep, origin: Origin) -> WorldSweep:
        """Return the sweep without its false returns; only a grid has neighbouring beams."""
        beams = origin.beams
        if not beams.is_image:
            return placed
        false = range_image.false_returns(
            image_of(placed, beams),
            beams.table.closed,
            farthest_m=SMALLEST / max(beams.column_step, LEAST_STEP),
            deviation_m=origin.deviation,
        )
        return placed if false is None else placed.without(false.ravel())
