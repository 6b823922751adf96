"""Evidence of missing floor: beams without return that head for it, over the sweeps of a mission.

A hole without anything below it within the range sends no beam back; nor do a wet or black floor,
or a sensor that loses its echoes in a part of its view.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.ground_fit import TILE, TILES
from wayproof.maps.kernels import ground_fit as kernels
from wayproof.maps.sweep import Ranges

HOLE_SWEEPS = 20
"""Sweeps in a row in which floor is silent where it is missing, 2 s at 10 Hz: of patches of 30 % of
a sweep that are lost again in each, 20 lie over one place once in 10^10 times."""

MAX_TILE = 1 << 24
"""Farthest tile along an axis, from the origin: 4000 km."""


class MissingFloor:
    """The tiles of floor about the sensor that were silent in the last sweeps.

    Attributes:
        silent_sweeps: (TILES, TILES) uint8 sweeps in a row in which a tile was silent, up to
            `HOLE_SWEEPS`.
        tile: Tile (x, y) of the world that the middle one is: the sensor's.
    """

    def __init__(self) -> None:
        """Start before the first sweep."""
        self.silent_sweeps = np.zeros((TILES, TILES), np.uint8)
        self.tile = 0, 0

    def lost_echoes(
        self,
        origins: NDArray[np.float64],
        moments: NDArray[np.int32],
        directions: NDArray[np.float64],
        ranges_mm: Ranges,
        range_limit: float,
    ) -> NDArray[np.bool_]:
        """Take in the next sweep: find its beams without return that are no evidence of a hole.

        Args:
            origins: (m, 3) where beams start, m, world; the floor is at z = 0.
            moments: (n,) origin of each beam.
            directions: (n, 3) unit vectors, world.
            ranges_mm: (n,) mm.
            range_limit: Range up to which no return clears, m.

        Returns:
            (n,) whether each heads for the floor and is none.
        """
        x, y = origins[0, :2].tolist()
        self._centre_on(int(np.floor(x / TILE)), int(np.floor(y / TILE)))
        return _lost_echoes(
            origins,
            moments,
            directions,
            ranges_mm,
            range_limit=range_limit,
            centre=(self.tile[0] * TILE, self.tile[1] * TILE),
            within=math.inf,  # from below a crest too: what returns there shows how low it is
            least_sweeps=HOLE_SWEEPS,
            silent_sweeps=self.silent_sweeps,
        )

    def restore(self, silent_sweeps: NDArray[np.uint8], tile: tuple[int, int]) -> None:
        """Take over the tiles of another one.

        Args:
            silent_sweeps: (TILES, TILES).
            tile: Tile (x, y) of the world that the middle one is.

        Raises:
            ValueError: They are of another shape, above `HOLE_SWEEPS` or too far away.
        """
        if silent_sweeps.shape != (TILES, TILES):
            raise ValueError(f"{silent_sweeps.shape} tiles of floor, expected {(TILES, TILES)}")
        if (most := int(silent_sweeps.max())) > HOLE_SWEEPS:
            raise ValueError(f"{most} silent sweeps, expected up to {HOLE_SWEEPS}")
        if max(map(abs, tile)) > MAX_TILE:
            raise ValueError(f"floor about tile {tile}, expected up to {MAX_TILE}")
        self.silent_sweeps, self.tile = silent_sweeps.copy(), tile

    def _centre_on(self, x: int, y: int) -> None:
        """Move the window of tiles along with the sensor; those that come in were not seen."""
        along_x, along_y = x - self.tile[0], y - self.tile[1]
        if along_x == along_y == 0:
            return
        moved = np.zeros_like(self.silent_sweeps)
        if max(abs(along_x), abs(along_y)) < TILES:
            (to_x, from_x), (to_y, from_y) = _overlap(along_x), _overlap(along_y)
            moved[to_x, to_y] = self.silent_sweeps[from_x, from_y]
        self.silent_sweeps, self.tile = moved, (x, y)


def lost_echoes_of_one(
    origins: NDArray[np.float64],
    moments: NDArray[np.int32],
    directions: NDArray[np.float64],
    ranges_mm: Ranges,
    range_limit: float,
) -> NDArray[np.bool_]:
    """Find the beams without return that are no evidence of a hole, by their sweep alone.

    Args:
        origins: (m, 3) where beams start, m, world; the floor is at z = 0.
        moments: (n,) origin of each beam.
        directions: (n, 3) unit vectors, world.
        ranges_mm: (n,) mm.
        range_limit: Range up to which no return clears, m.

    Returns:
        (n,) whether each heads for the floor and is none.
    """
    return _lost_echoes(
        origins,
        moments,
        directions,
        ranges_mm,
        range_limit=range_limit,
        centre=(float(origins[0, 0]), float(origins[0, 1])),
        within=TILE,
        least_sweeps=1,
        silent_sweeps=np.zeros((TILES, TILES), np.uint8),
    )


def _lost_echoes(
    origins: NDArray[np.float64],
    moments: NDArray[np.int32],
    directions: NDArray[np.float64],
    ranges_mm: Ranges,
    *,
    range_limit: float,
    centre: tuple[float, float],
    within: float,
    least_sweeps: int,
    silent_sweeps: NDArray[np.uint8],
) -> NDArray[np.bool_]:
    lost = np.empty(len(ranges_mm), np.bool_)
    kernels.find_lost(
        origins,
        moments,
        directions,
        range_limit,
        centre,
        TILE,
        within,
        least_sweeps,
        ranges_mm,
        silent_sweeps,
        lost,
    )
    return lost


def _overlap(moved: int) -> tuple[slice, slice]:
    """Return the tiles along an axis that a window keeps as it moves, new and old."""
    if moved >= 0:
        return slice(0, TILES - moved), slice(moved, TILES)
    return slice(-moved, TILES), slice(0, TILES + moved)


def warm_up() -> None:
    """Compile the kernel for a sweep of 16 bits."""
    directions = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    beams = np.array([[0.0, 0.0, 0.5]]), np.zeros(2, np.int32), directions
    lost_echoes_of_one(*beams, np.array([500, 65535], np.uint16), range_limit=1.0)
