"""Endpoints of the beams of a sweep, in whole sub-cells: 1/512 of a cell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.kernels import beams
from wayproof.maps.sweep import Sweep, SweepStatistics


@dataclass(frozen=True)
class BeamRanges:
    """Lengths of the beams of a sweep, and which of them hit a surface.

    Attributes:
        informative: (n,) whether each is evidence: it was neither dropped nor too near.
        returned: (n,) whether each hit a surface.
        metres: (n,) distance to that surface, or range up to which a beam without return clears.
        count: Number of beams by fate: returned, cleared, dropped, too near.
    """

    informative: NDArray[np.bool_]
    returned: NDArray[np.bool_]
    metres: NDArray[np.float64]
    count: tuple[int, int, int, int]

    @classmethod
    def of_sweep(cls, sweep: Sweep) -> Self:
        """Classify the beams of a sweep.

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
        informative = ~(dropped | near)
        cleared = informative & ((millimetres > farthest) | (millimetres == beams.NO_RETURN_MM))
        returned = informative & ~cleared
        fates = returned, cleared, dropped, near
        hits, clears, lost, ignored = (int(np.count_nonzero(fate)) for fate in fates)
        metres = np.where(cleared, farthest, millimetres) / 1000.0
        return cls(informative, returned, metres, (hits, clears, lost, ignored))


@dataclass(frozen=True)
class BeamEndpoints:
    """Endpoints of the informative beams of a sweep.

    Attributes:
        points: (k, 3) sub-cells that they end in.
        moments: (k,) index of the origin of each.
        returned: (k,) whether each hit a surface; else it only clears.
        count: Number of beams by fate: returned, cleared, dropped, too near.
    """

    points: NDArray[np.int64]
    moments: NDArray[np.int64]
    returned: NDArray[np.bool_]
    count: tuple[int, int, int, int]

    @classmethod
    def of_sweep(cls, sweep: Sweep) -> Self:
        """Find the endpoints of a sweep.

        Raises:
            ValueError: A direction is not of unit length.
        """
        ranges = BeamRanges.of_sweep(sweep)
        informative, sources = ranges.informative, sweep.sources
        reached = sweep.origins[sources[informative]]
        reached = reached + sweep.directions[informative] * ranges.metres[informative, None]
        places = np.floor(reached * (beams.SUBCELLS / sweep.resolution)).astype(np.int64)
        return cls(
            places + np.array([0, 0, beams.FLOOR_SUBCELLS]),
            sources[informative].astype(np.int64),
            ranges.returned[informative],
            ranges.count,
        )

    def merged(self) -> BeamEndpoints:
        """Merge beams from one origin into one cell to one beam, to the mean of their endpoints.

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
        # Sums of whole numbers below 2^53: exact in any order.
        inside = self.points - (corner << beams.SUBCELL_BITS)
        sums = [np.bincount(group, weights=inside[:, axis]) for axis in range(3)]
        means = np.stack(sums, axis=1).astype(np.int64) // members[:, None]
        points = means + (corner << beams.SUBCELL_BITS)
        return BeamEndpoints(points, self.moments[first], self.returned[first], self.count)

    def statistics(self, cells_updated: int) -> SweepStatistics:
        """Return the statistics of the sweep."""
        return SweepStatistics(*self.count, cells_updated)
