"""What every representation of space answers, whatever it holds inside."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.maps.columns import ColumnMap
from wayproof.maps.config import MapConfig
from wayproof.maps.sweep import SweepStatistics


class Representation(ColumnMap, Protocol):
    """A map that sweeps go into and that a costmap is made from; see `VoxelMap` for each method."""

    config: MapConfig

    def integrate(
        self,
        origins: ArrayLike,
        directions: NDArray[np.float64],
        ranges_mm: NDArray[np.uint16],
        range_limit: float,
        time_ns: int,
        moments: NDArray[np.int32] | None = None,
    ) -> SweepStatistics:
        """Take in one sweep."""

    def mark_free(self, low: ArrayLike, high: ArrayLike, time_ns: int) -> None:
        """Lower the cells whose centres lie in a box, except occupied ones."""

    def mark_free_sphere(self, centre: ArrayLike, radius: float, time_ns: int) -> None:
        """Lower the cells whose centres lie in a sphere, except occupied ones."""

    def mark_floor(self, low: ArrayLike, high: ArrayLike, time_ns: int) -> None:
        """Raise the floor's cells whose centres lie in a rectangle, except free ones."""

    def advance(self, time_ns: int) -> None:
        """Apply every decay tick due."""

    def state_at(self, points: ArrayLike) -> NDArray[np.uint8]:
        """The states at points (n, 3), m, world: (n,)."""

    def probability_at(self, points: ArrayLike) -> NDArray[np.float64]:
        """The probabilities of occupancy at points (n, 3), m, world: (n,)."""

    def observed_ns_at(self, points: ArrayLike) -> NDArray[np.int64]:
        """When the surroundings of points (n, 3) were last observed: (n,) ns; -1 never."""

    def version(self) -> str:
        """Digest of the content, 32 hex digits."""

    def counts(self) -> dict[str, int]:
        """Number of cells by the name of their state."""

    def memory_bytes(self) -> int:
        """Bytes that the map holds."""


class Maker(Protocol):
    """What `MAPS` holds: it makes an unknown map."""

    def __call__(
        self,
        config: MapConfig,
        threads: int = 1,
        low: ArrayLike | None = None,
        high: ArrayLike | None = None,
    ) -> Representation:
        """Make it.

        Args:
            config: The settings.
            threads: That share the work of a sweep.
            low: (3,) least corner of the region of interest, m, world; what lies outside need not
                be held. None: all space is of interest.
            high: (3,) greatest corner.
        """
