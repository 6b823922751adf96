"""The interface of every map: sweeps go in, states of cells come out."""

from __future__ import annotations

from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.maps.cell_sets import CellMask, ball_mask, box_mask, floor_mask
from wayproof.maps.columns import ColumnMap
from wayproof.maps.config import MapConfig
from wayproof.maps.states import FREE, OCCUPIED
from wayproof.maps.sweep import Ranges, Spared, SweepStatistics


class Representation(ColumnMap, Protocol):
    """A map that sweeps go into and that a costmap is made from; see `VoxelMap` for each method.

    A class that derives from it need not define the methods that have a body here. `DenseMap`
    derives all of them from two to five.

    Attributes:
        decays: Whether what is not observed is forgotten, by `half_life`.
        exempts: Whether a region can be exempt from that, by `no_decay_radius`.
        config: The settings.
    """

    decays: ClassVar[bool] = True
    exempts: ClassVar[bool] = False
    config: MapConfig

    def __init__(
        self,
        config: MapConfig,
        low: ArrayLike | None = None,
        high: ArrayLike | None = None,
    ) -> None:
        """Make an unknown map.

        Args:
            config: The settings.
            low: (3,) least corner of the region of interest, m, world; what lies outside need not
                be held. None: all space is of interest.
            high: (3,) greatest corner, m, world.

        Raises:
            ValueError: A value is out of its range, or the map cannot have one of the settings.
        """

    def integrate(
        self,
        origins: ArrayLike,
        directions: NDArray[np.float64],
        ranges_mm: Ranges,
        range_limit: float,
        time_ns: int,
        moments: NDArray[np.int32] | None = None,
        spared: Spared = "floor",
    ) -> SweepStatistics:
        """Take in one sweep."""

    def mark(self, cells: CellMask, state: int, time_ns: int) -> None:
        """Make cells free, except occupied ones, or occupied, except free ones."""

    def mark_free(self, low: ArrayLike, high: ArrayLike, time_ns: int) -> None:
        """Make the cells whose centres lie in a box free, except occupied ones.

        For space that a body occupies itself, or a start area that is declared clear: an obstacle
        that was seen stays.

        Args:
            low: (3,) least corner, m, world.
            high: (3,) greatest corner, m, world.
            time_ns: Simulated time, ns.

        Raises:
            ValueError: A corner is not finite, or the time is negative.
        """
        self.mark(box_mask(low, high, self.resolution), FREE, time_ns)

    def mark_free_sphere(self, centre: ArrayLike, radius: float, time_ns: int) -> None:
        """Make the cells whose centres lie in a ball free, except occupied ones.

        Args:
            centre: (3,) m, world.
            radius: m.
            time_ns: Simulated time, ns.

        Raises:
            ValueError: The ball is not finite, or the time is negative.
        """
        self.mark(ball_mask(centre, radius, self.resolution), FREE, time_ns)

    def mark_floor(
        self, low: ArrayLike, high: ArrayLike, time_ns: int, height: float = 0.0
    ) -> None:
        """Make the floor's cells whose centres lie in a rectangle occupied, except free ones.

        For the ground under a standing body, which none of its beams reach.

        Args:
            low: (2,) least corner, m, world.
            high: (2,) greatest corner, m, world.
            time_ns: Simulated time, ns.
            height: Height of the floor, m, world.

        Raises:
            ValueError: A corner or the height is not finite, or the time is negative.
        """
        self.mark(floor_mask(low, high, self.resolution, height), OCCUPIED, time_ns)

    def exempt_from_decay(self, low: ArrayLike, high: ArrayLike, time_ns: int) -> None:
        """Exempt the cells of a box from the next decay tick.

        Raises:
            ValueError: The map exempts no cells.
        """
        raise ValueError(f"{type(self).__name__}: exempts no cells from decay")

    def advance(self, time_ns: int) -> None:
        """Apply every decay tick due."""

    def state_at(self, points: ArrayLike) -> NDArray[np.uint8]:
        """Return the states at points (n, 3), m, world: (n,)."""

    def probability_at(self, points: ArrayLike) -> NDArray[np.float64]:
        """Return the probabilities of occupancy at points (n, 3), m, world: (n,)."""

    def observed_ns_at(self, points: ArrayLike) -> NDArray[np.int64]:
        """Return when points (n, 3), m, world, were last observed: (n,) ns; -1 never.

        The time may be that of the surroundings of a point: a brick or a block.
        """

    def version(self) -> str:
        """Return a digest of the content, 32 hex digits."""

    def counts(self) -> dict[str, int]:
        """Return the number of cells by the name of their state."""

    def memory_bytes(self) -> int:
        """Return the bytes that the map holds."""


def refuse_unsupported(kind: type[Representation], config: MapConfig) -> None:
    """Refuse settings that a kind of map cannot have.

    Raises:
        ValueError: Decay of a kind without decay, or an exemption of one without exemptions.
    """
    if config.half_life > 0.0 and not kind.decays:
        raise ValueError(
            f"map.half_life: got {config.half_life:g}, expected 0 with map.kind {config.kind!r}, "
            "which has no decay"
        )
    if config.no_decay_radius > 0.0 and not kind.exempts:
        raise ValueError(
            f"map.no_decay_radius: got {config.no_decay_radius:g}, expected 0 with map.kind "
            f"{config.kind!r}, which exempts no cells from decay"
        )
