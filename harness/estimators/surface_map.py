"""Map of a lidar odometry: one plane in each voxel that sweeps have met."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.estimators.kernels import (
    EMPTY,
    LEAST_INLIERS,
    Voxels,
    add_points,
    align,
    first_of_each,
    slot_of,
)
from wayproof.harness.estimators.registration import Registration
from wayproof.models.arrays import Array

SLOTS = 1 << 14
"""Number of slots at the start."""

FULL = 0.5
"""Share of used slots above which the table doubles."""


class SurfaceMap:
    """Planes of surfaces by voxel, in the frame of the estimate.

    After Yuan et al. 2022, RA-L 7, "Efficient and probabilistic adaptive voxel mapping for accurate
    online LiDAR odometry", with voxels of one size.

    Attributes:
        voxels: The table.
        count: Number of voxels in it.
    """

    def __init__(self, voxel: float, held: float, registered_share: float) -> None:
        """Start empty.

        Args:
            voxel: Edge of a voxel, m.
            held: Least information of a direction that the scene holds.
            registered_share: Least share of a sweep's points near a plane of the map; with less the
                sweep is not registered.
        """
        self._inverse, self._held, self._share = 1.0 / voxel, held, registered_share
        self.voxels = _table(SLOTS)
        self.count = 0

    def add(self, points: Array) -> None:
        """Add points (n, 3), world, m."""
        while self.count + len(points) > FULL * len(self.voxels.keys):
            self._double()
        self.count += add_points(points, self._inverse, self.voxels)

    def register(self, points: Array, predicted: Array) -> Registration:
        """Align points with the map.

        Args:
            points: (n, 3) placed by the predicted poses, world, m.
            predicted: (3,) position of the base at the end of the sweep, m.
        """
        correction, information, axes = np.empty(4), np.empty(3), np.empty((3, 3))
        inliers = align(
            points - predicted,
            predicted,
            self._inverse,
            self._held,
            self.voxels,
            correction,
            information,
            axes,
        )
        if inliers < max(LEAST_INLIERS, self._share * len(points)):
            return Registration(np.zeros(4), np.zeros(3), np.eye(3), inliers)
        unheld = axes[:, information < self._held]
        return Registration(correction, information, np.ascontiguousarray(unheld.T), inliers)

    def _double(self) -> None:
        old = self.voxels
        self.voxels = _table(2 * len(old.keys))
        for slot in np.flatnonzero(old.keys != EMPTY).tolist():
            new = slot_of(self.voxels.keys, old.keys[slot])
            for was, now in zip(old, self.voxels, strict=True):
                now[new] = was[slot]


def thinned(points: Array, spacing: float) -> Array:
    """Return the first point of each voxel of an edge of `spacing`, in their order, (k, 3) m."""
    slots = 1 << int(2 * len(points) + 1).bit_length()
    chosen = np.empty(len(points), np.int64)
    count = first_of_each(points, 1.0 / spacing, np.empty(slots, np.int64), chosen)
    kept: Array = points[chosen[:count]]
    return kept


def _table(slots: int) -> Voxels:
    return Voxels(
        keys=np.full(slots, EMPTY, np.int64),
        counts=np.zeros(slots, np.int64),
        means=np.zeros((slots, 3)),
        squares=np.zeros((slots, 6)),
        planes=np.zeros((slots, 4)),
    )


def warm_up() -> None:
    """Compile the kernels, or load them from the cache."""
    surfaces = SurfaceMap(0.3, held=0.04, registered_share=0.25)
    grid: NDArray[np.float64] = np.mgrid[:8, :8, :1].reshape(3, -1).T * 0.07
    surfaces.add(thinned(grid, 0.01))
    surfaces.register(grid, np.zeros(3))
