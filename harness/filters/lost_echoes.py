"""Single beams that lost their echo."""

from __future__ import annotations

from wayproof.harness.filters.filter import Filter, Origin, image_of
from wayproof.harness.inputs import WorldSweep
from wayproof.maps import range_image
from wayproof.models.sensors.beams import NO_RETURN


class LostEchoes(Filter):
    """Drops beams without return between returns.

    A sensor that reports no return as free space would clear what those beams met.
    """

    def __call__(self, placed: WorldSweep, origin: Origin) -> WorldSweep:
        """Return the sweep without these beams; only a grid has neighbouring ones."""
        beams = origin.beams
        if not beams.is_image or not (placed.ranges_mm == NO_RETURN).any():
            return placed
        lost = range_image.lost_echoes(image_of(placed, beams), beams.table.closed)
        return placed.without(lost.ravel())
