"""Cells of simple shapes, and sets of cells: arrays (m, 3) in lexical order, each once."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.maps.grid import FLOOR_HEIGHT_IN_CELL, cell_box, centres, finite_vector
from wayproof.maps.kernels import tracking as kernels


class CellMask(NamedTuple):
    """Some cells of a box.

    Attributes:
        first: (3,) least cell of the box.
        inside: (nx, ny, nz) which of its cells are meant.
    """

    first: NDArray[np.int64]
    inside: NDArray[np.bool_]

    def cells(self) -> NDArray[np.int64]:
        """Return the cells (n, 3) in lexical order."""
        cells: NDArray[np.int64] = np.argwhere(self.inside) + self.first
        return cells


def box_mask(low: ArrayLike, high: ArrayLike, resolution: float) -> CellMask:
    """Return the cells whose centres lie in a box, corners (3,) in m.

    Raises:
        ValueError: A corner is not finite.
    """
    first, end = cell_box(low, high, resolution)
    return CellMask(first, np.ones(end - first, np.bool_))


def ball_mask(centre: ArrayLike, radius: float, resolution: float) -> CellMask:
    """Return the cells whose centres lie in a ball; centre (3,) and radius in m.

    Raises:
        ValueError: The ball is not finite.
    """
    middle = finite_vector("centre", centre)
    first, end = cell_box(middle - radius, middle + radius, resolution)
    cells = np.moveaxis(np.indices(tuple(end - first)), 0, -1) + first  # (nx, ny, nz, 3)
    squared = np.square(centres(cells, resolution) - middle).sum(axis=-1)
    return CellMask(first, squared <= radius * radius)


def floor_mask(low: ArrayLike, high: ArrayLike, resolution: float, height: float = 0.0) -> CellMask:
    """Return the cells of a floor at a height whose centres lie in a rectangle, corners (2,) in m.

    Raises:
        ValueError: A corner or the height is not finite.
    """
    first, end = cell_box([*np.ravel(low), height], [*np.ravel(high), height], resolution)
    first[2] = math.floor(height / resolution + FLOOR_HEIGHT_IN_CELL)
    end[2] = first[2] + 1
    return CellMask(first, np.ones(end - first, np.bool_))


def as_set(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return cells (n, 3) in lexical order, each once."""
    ordered = cells[np.lexsort(cells.T[::-1])]
    first = np.ones(len(ordered), np.bool_)
    first[1:] = np.any(ordered[1:] != ordered[:-1], axis=1)
    return ordered[first]


def member(part: NDArray[np.int64], cells: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return whether cells (n, 3) are in a set (m, 3): (n,)."""
    places = np.empty(len(cells), np.int64)
    kernels.find_indices(part, cells, places)
    return places >= 0


def slabs(
    cells: NDArray[np.int64],
    start: NDArray[np.float64],
    toward: NDArray[np.float64],
    resolution: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return where a ray enters and leaves cells (n, 3), m along it, (n,); out of order: a miss.

    Kay & Kajiya 1986, "Ray tracing complex scenes".
    """
    middles, half = centres(cells, resolution), 0.5 * resolution
    way = toward + 0.0  # -0 would turn the faces around
    with np.errstate(divide="ignore", invalid="ignore"):
        first = (middles - half - start) / way
        second = (middles + half - start) / way
    # 0 / 0: the ray runs in a face, which belongs to the cell above it.
    first, second = np.nan_to_num(first, nan=-np.inf), np.nan_to_num(second, nan=-np.inf)
    entries = np.minimum(first, second).max(axis=1, initial=-np.inf)
    return entries, np.maximum(first, second).min(axis=1, initial=np.inf)
