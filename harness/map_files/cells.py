"""The cells of a map in a box."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.maps import FREE, OCCUPIED, Representation
from wayproof.maps.columns import WORD_BITS, Window, unpack


@dataclass(frozen=True)
class Cells:
    """States of the cells in a box.

    Attributes:
        states: (nx, ny, nz) unknown, free or occupied.
        first: (3,) indices of the first cell on the map's lattice.
        origin: (3,) corner of the first cell, m, world.
        resolution: Edge of a cell, m.
    """

    states: NDArray[np.uint8]
    first: tuple[int, int, int]
    origin: NDArray[np.float64]
    resolution: float

    def centres(self, state: int) -> NDArray[np.float64]:
        """Return the centres (n, 3) of the cells of a state, m, world."""
        places = np.argwhere(self.states == state)
        centres: NDArray[np.float64] = self.origin + (places + 0.5) * self.resolution
        return centres


def cells_within(a_map: Representation, low: ArrayLike, high: ArrayLike) -> Cells:
    """Return the cells of a map that cover a box.

    Args:
        a_map: Any map.
        low: (3,) least corner, m, world.
        high: (3,) greatest corner, m, world.
    """
    window = Window.covering(low, high, a_map.resolution)
    nx, ny, nz = window.shape
    occupied, free = a_map.columns(window.first, (nx, ny, -(-nz // WORD_BITS)))
    states = unpack(free, nz) * np.uint8(FREE) + unpack(occupied, nz) * np.uint8(OCCUPIED)
    return Cells(states, window.first, window.origin, a_map.resolution)
