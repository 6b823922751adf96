"""Where the beams of a sweep end, in whole sub-cells: 1/512 of a cell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.kernels import beams
from wayproof.maps.sweep import Sweep, SweepStatistics


@dataclass(frozen=True)
class BeamRanges:
    """How far the beams of a sweep went, and which of them met something.

    Attributes:
        told: (n,) whether each tells anything: it was neither dropped nor too near.
        returned: (n,) whether each met a surface.
        metres: (n,) to that surface, or up to where a beam without return clears.
        count: Of all beams by their fate: returned, cleared, dropped, too near.
    """

    told: NDArray[np.bool_]
    returned: NDArray[np.bool_]
    metres: NDArray[np.float64]
    count: tuple[int, int, int, int]

    @classmethod
    def of_sweep(cls, sweep: Sweep) -> Self:
        """Find them.

        Raises:
            ValueError: A direction is not of unit length.
        """
        squared = np.square(sweep.directions).sum(axis=1)
        strange = ~(np.abs(squared - 1.0) < beams.UNIT_TOLERANCE)  # also NaN
        if strange.any():
            raise ValueError(
                f"directions: got {sweep.directions[strange][0]}, expected unit length"
            )
        nearest, farthest = sweep.limits_mm
        millimetres = sweep.ranges_mm.astype(np.int64)
        dropped = millimetres == beams.DROPPED_MM
        near = (millimetres < nearest) & ~dropped
        told = ~(dropped | near)
        cleared = told & ((millimetres > farthest) | (millimetres == beams.NO_RETURN_MM))
        returned = told & ~cleared
        fates = returned, cleared, dropped, near
        hits, clears, lost, ignored = (int(np.count_nonzero(fate)) for fate in fates)
        metres = np.where(cleared, farthest, millimetres) / 1000.0
        return cls(told, returned, metres, (hits, clears, lost, ignored))


@dataclass(frozen=True)
class BeamEndpoints:
    """What the beams of a sweep tell: those that were dropped or too near tell nothing.

    Attributes:
        points: (k, 3) sub-cells that they end in.
        moments: (k,) index of the origin of each.
        returned: (k,) whether each met a surface; else it only clears.
        count: Of all beams by their fate: returned, cleared, dropped, too near.
    """

    points: NDArray[np.int64]
    moments: NDArray[np.int64]
    returned: NDArray[np.bool_]
    count: tuple[int, int, int, int]

    @classmethod
    def of_sweep(cls, sweep: Sweep) -> Self:
        """Find the ends.

        Raises:
            ValueError: A direction is not of unit length.
        """
        lengths = BeamRanges.of_sweep(sweep)
        told, sources = lengths.told, sweep.sources
        reached = sweep.origins[sources[told]]
        reached = reached + sweep.directions[told] * lengths.metres[told, None]
        places = np.floor(reached * (beams.SUBCELLS / sweep.resolution)).astype(np.int64)
        return cls(
            places + np.array([0, 0, beams.FLOOR_SUBCELLS]),
            sources[told].astype(np.int64),
            lengths.returned[told],
            lengths.count,
        )

    def merged(self) -> BeamEndpoints:
        """One beam for all that leave one origin and end in one cell, to the mean of their ends.

        Those with a return stay apart from those without (the merged integrator of Oleynikova et
        al. 2017, "Voxblox", IV-B).
        """
        if len(self.points) == 0:
            return self
        cells = self.points >> beams.SUBCELL_BITS
        corner = cells.min(axis=0)
        extent = cells.max(axis=0) - corner + 1
        names = 2 * self.moments + self.returned
        for axis in range(3):
            names = names * extent[axis] + (cells[:, axis] - corner[axis])
        _, first, group, members = np.unique(
            names, return_index=True, return_inverse=True, return_counts=True
        )
        # Sums of whole numbers below 2^53: exact in whatever order.
        inside = self.points - (corner << beams.SUBCELL_BITS)
        sums = [np.bincount(group, weights=inside[:, axis]) for axis in range(3)]
        means = np.stack(sums, axis=1).astype(np.int64) // members[:, None]
        points = means + (corner << beams.SUBCELL_BITS)
        return BeamEndpoints(points, self.moments[first], self.returned[first], self.count)

    def statistics(self, cells_updated: int) -> SweepStatistics:
        """What became of the sweep."""
        return SweepStatistics(*self.count, cells_updated)
