"""Beams that end in the surface which they graze."""

from __future__ import annotations

from dataclasses import replace

from wayproof.harness.filters.filter import Filter, Origin
from wayproof.harness.inputs import WorldSweep


class Grazing(Filter):
    """Keeps a beam that ends in the floor's layer from clearing cells of that layer.

    At grazing angles it would take away the floor that it is about to hit. Where the robot climbs
    the same holds for each beam that goes down, whatever layer it ends in, so that those which pass
    over a slope do not clear its surface.
    """

    def __call__(self, placed: WorldSweep, origin: Origin) -> WorldSweep:
        """Return the sweep with the layer that its beams spare."""
        own = self.config.costmap.max_slope > 0.0 and self.mission.rest_height > 0.0
        return replace(placed, spared="own" if own else "floor")
