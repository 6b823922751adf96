"""A bounded window of an unbounded map, as dense arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from maps.grid import FLOOR_HEIGHT_IN_CELL, FLOOR_LAYER, ROUNDING, finite_vector
from maps.marks import unpack_bits
from maps.states import FREE, OCCUPIED
from maps.voxel import VoxelMap

MAX_CELLS = 200_000_000


@dataclass(frozen=True)
class Layers:
    """Where the floor lies among a window's layers.

    Attributes:
        floor_layer: Index along z of the layer that holds the plane z = 0; may lie outside.
    """

    floor_layer: int


class Window:
    """The cells of a map that lie in a box.

    Attributes:
        resolution: Edge of a cell, m.
        origin: (3,) corner of the first cell, m, world.
        shape: (nx, ny, nz) cells.
        grid: Where the floor lies among them.
    """

    def __init__(self, voxel_map: VoxelMap, low: ArrayLike, high: ArrayLike) -> None:
        """Lay a window over a map.

        Args:
            voxel_map: The map.
            low: (3,) least corner, m, world; the cells reach at least this far.
            high: (3,) greatest corner, m, world; likewise.

        Raises:
            ValueError: The box is empty or not finite, or holds too many cells.
        """
        least, greatest = finite_vector("low", low), finite_vector("high", high)
        if not np.all(least < greatest):
            raise ValueError(f"bounds: got low {least} and high {greatest}, expected low < high")
        self.resolution = voxel_map.resolution
        shift = np.array([0.0, 0.0, FLOOR_HEIGHT_IN_CELL])
        first = np.floor(least / self.resolution + shift + ROUNDING).astype(np.int64)
        end = np.ceil(greatest / self.resolution + shift - ROUNDING).astype(np.int64)
        nx, ny, nz = (int(n) for n in end - first)
        if nx * ny * nz > MAX_CELLS:
            raise ValueError(
                f"bounds: got {nx * ny * nz} cells {(nx, ny, nz)}, expected at most {MAX_CELLS}"
            )
        self.shape = (nx, ny, nz)
        self.origin = (first - shift) * self.resolution
        self.grid = Layers(FLOOR_LAYER - int(first[2]))
        self._map = voxel_map
        self._first = first

    @property
    def log_odds(self) -> NDArray[np.int16]:
        """The sign of each cell's log-odds, (nx, ny, nz)."""
        occupied, free = self._bits()
        return occupied.astype(np.int16) - free

    def states(self) -> NDArray[np.uint8]:
        """The state of each cell, (nx, ny, nz)."""
        occupied, free = self._bits()
        return free * np.uint8(FREE) + occupied * np.uint8(OCCUPIED)

    def _bits(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        nx, ny, nz = self.shape
        occupied, free = self._map.columns(self._first, (nx, ny, -(-nz // 64)))
        return unpack_bits(occupied)[:, :, :nz], unpack_bits(free)[:, :, :nz]
