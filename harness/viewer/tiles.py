"""Occupied cells of a map in square tiles, so that only changed ones are sent again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.maps import Representation
from wayproof.maps.columns import WORD_BITS, Window, layer_bits, unpack

TILE = 32
"""Number of columns along each side of a tile."""

MOST_BELOW = 32
"""Maximum number of layers from the floor up to the first shown."""


@dataclass(frozen=True)
class Tile:
    """Copy of one tile of a map.

    Attributes:
        name: Name of its place.
        corner: (3,) lower corner of its first cell, m, world.
        bits: (nx, ny, words) occupied cells.
    """

    name: str
    corner: NDArray[np.float64]
    bits: NDArray[np.uint64]


class Tiles:
    """Occupied cells above the floor, as last returned.

    The layer of the floor is left out: it would hide everything on it.
    """

    def __init__(self, low: ArrayLike, high: ArrayLike, resolution: float) -> None:
        """Create tiles without cells for a box of space with corners (3,), m, world."""
        window = Window.covering(low, high, resolution)
        first = min(max(window.floor_layer + 1, 0), window.shape[2] - 1)
        shown = window.layers(first, window.shape[2])
        # A flat grid has no window without the floor, so some layers below are read with them.
        below = min(max(shown.first[2], 0), MOST_BELOW)
        self._window = shown.layers(-below, shown.shape[2])
        self._shown = layer_bits(below, self._window.shape[2], self._window.shape[2])
        nx, ny, nz = self._window.shape
        self._told = np.zeros((nx, ny, -(-nz // WORD_BITS)), np.uint64)

    def changed(self, a_map: Representation) -> list[Tile]:
        """Return the tiles with a cell that changed since the last call."""
        window = self._window
        occupied, _ = a_map.columns(window.first, self._told.shape)
        bits = np.ascontiguousarray(occupied & self._shown)
        turned = (bits != self._told).any(axis=2)  # (nx, ny)
        self._told = bits
        found = []
        for x, y in np.argwhere(_in_tiles(turned)).tolist():
            part = bits[x * TILE : (x + 1) * TILE, y * TILE : (y + 1) * TILE]
            corner = window.origin + window.resolution * TILE * np.array([x, y, 0])
            found.append(Tile(f"{x}_{y}", corner, part))
        return found

    def centres(self, tile: Tile) -> NDArray[np.float64]:
        """Return the centres (n, 3) of the occupied cells of a tile, m, world."""
        window = self._window
        x, y = np.nonzero(tile.bits.any(axis=2))  # few columns have any
        column, z = np.nonzero(unpack(tile.bits[x, y][None], window.shape[2])[0])
        middles = 0.5 + np.stack([x[column], y[column], z], axis=1)
        centres: NDArray[np.float64] = window.resolution * middles + tile.corner
        return centres


def _in_tiles(columns: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which tiles have one of these columns (nx, ny)."""
    for axis, length in enumerate(columns.shape):
        columns = np.logical_or.reduceat(columns, np.arange(0, length, TILE), axis=axis)
    return columns
