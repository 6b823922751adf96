"""Free space of a costmap for one body, by what the policy admits, knows and may pass."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.mission import Mission
from wayproof.harness.stack.footprint import NARROWEST, body_of, costs
from wayproof.maps import Costmap, Distances
from wayproof.planners import Disc, FreeSpace
from wayproof.planners.body import collision_distance_sq

Array = NDArray[np.float64]


class Spaces(NamedTuple):
    """Free space under three readings of the unknown.

    Attributes:
        admitted: Space that the unknown policy lets the body enter.
        known: Space known to be free.
        passable: Space not known to be blocked; what is not known to be free costs most.
    """

    admitted: FreeSpace
    known: FreeSpace
    passable: FreeSpace


class FreeSpaces:
    """Free space for one mission's body.

    A body that is longer than wide is several discs at its heading (oriented), or one disc about
    all of them (circumscribed), which may turn as it likes.
    """

    def __init__(self, config: Config, mission: Mission, costmap: Costmap) -> None:
        """Read one costmap."""
        self._config, self._costmap = config, costmap
        self._body = body_of(mission)
        self._oriented = bool(mission.discs)
        self._slender = self._body.circumscribed_radius - min(self._body.radii)
        self._costs_of: Array | None = None
        self._cost_by_distance = np.empty(0)

    def circumscribed(self) -> Spaces:
        """Free space for the disc about the body."""
        return self._spaces(wide=self._oriented)

    def oriented(self) -> Spaces:
        """Free space for the body's discs at its heading; of a round body, for its one disc."""
        return self._spaces(wide=False)

    def inflation_radius(self, space: FreeSpace) -> float:
        """Of the disc or discs that a space is for, m."""
        return self._costmap.inflation_radius + (0.0 if space.discs else self._slender)

    def _spaces(self, wide: bool) -> Spaces:
        costmap = self._costmap
        admitted = known = self._space(costmap.traversable, wide)
        if costmap.known_free is not costmap.traversable:
            known = self._space(costmap.known_free, wide)
        return Spaces(admitted, known, self._passable(wide))

    def _space(self, distances: Distances, wide: bool, table: Array | None = None) -> FreeSpace:
        """Free space for the circumscribed disc (wide) or the oriented discs, with a cost table."""
        costmap = self._costmap
        return FreeSpace(
            distances=distances,
            origin=costmap.origin,
            resolution=costmap.resolution,
            collision_distance_sq=self._threshold(wide),
            cost_by_distance=self._costs() if table is None else table,
            discs=() if wide else self._discs(),
            sparing=True,
        )

    def _costs(self) -> Array:
        """Costs by squared distance; recomputed when the costmap's own have changed."""
        if self._costs_of is not self._costmap.cost_table:
            self._costs_of = self._costmap.cost_table
            self._cost_by_distance = costs(self._costmap, self._body)
        return self._cost_by_distance

    def _threshold(self, wide: bool) -> int:
        """The largest forbidden squared distance, cells^2."""
        costmap = self._costmap
        if not wide:
            return costmap.collision_distance_sq
        radius = self._body.circumscribed_radius + costmap.margin
        return collision_distance_sq(radius, costmap.resolution, flat=True)

    def _discs(self) -> tuple[Disc, ...]:
        """The discs that are checked at the heading; none if the body is one."""
        if not self._oriented:
            return ()
        return self._body.discs(self._costmap.margin, self._costmap.resolution, flat=True)

    def _passable(self, wide: bool) -> FreeSpace:
        """Space not known to be blocked: distances to obstacles, an obstacle's edge where unknown.

        So a guide may cross the unknown, at `behaviour.unknown_cost`, and takes known space where
        it can.
        """
        edge = self._threshold(wide) + 1
        slender = self._oriented and not wide
        table = self._costs().copy()
        table[edge] = self._config.behaviour.unknown_cost + (NARROWEST if slender else 0.0)
        return self._space(self._costmap.optimistic(edge), wide, table)
