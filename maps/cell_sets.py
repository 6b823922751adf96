"""The cells of simple shapes, and sets of cells: arrays (m, 3) in order without repetition."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.maps.grid import FLOOR_LAYER, cell_box, centres, finite_vector
from wayproof.maps.kernels import tracking as kernels


def box_cells(first: NDArray[np.int64], end: NDArray[np.int64]) -> NDArray[np.int64]:
    """The cells (n, 3) of a box, from its least one up to another."""
    nx, ny, nz = (int(cells) for cells in end - first)
    places = [axis.ravel() for axis in np.indices((nx, ny, nz))]
    cells: NDArray[np.int64] = np.stack(places, axis=1) + first
    return cells


def ball_cells(centre: ArrayLike, radius: float, resolution: float) -> NDArray[np.int64]:
    """The cells (n, 3) whose centres lie in a ball; centre (3,) and radius in m.

    Raises:
        ValueError: The ball is not finite.
    """
    middle = finite_vector("centre", centre)
    cells = box_cells(*cell_box(middle - radius, middle + radius, resolution))
    squared = np.square(centres(cells, resolution) - middle).sum(axis=1)
    inside: NDArray[np.bool_] = squared <= radius * radius
    return cells[inside]


def floor_cells(low: ArrayLike, high: ArrayLike, resolution: float) -> NDArray[np.int64]:
    """The floor's cells (n, 3) whose centres lie in a rectangle, corners (2,) in m.

    Raises:
        ValueError: A corner is not finite.
    """
    first, end = cell_box([*np.ravel(low), 0.0], [*np.ravel(high), 0.0], resolution)
    first[2], end[2] = FLOOR_LAYER, FLOOR_LAYER + 1
    return box_cells(first, end)


def as_set(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Cells (n, 3) in lexical order, each once."""
    ordered = cells[np.lexsort(cells.T[::-1])]
    first = np.ones(len(ordered), np.bool_)
    first[1:] = np.any(ordered[1:] != ordered[:-1], axis=1)
    return ordered[first]


def member(part: NDArray[np.int64], cells: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether cells (n, 3) are in a set (m, 3): (n,)."""
    places = np.empty(len(cells), np.int64)
    kernels.locate_all(part, cells, places)
    return places >= 0


def slabs(
    cells: NDArray[np.int64],
    start: NDArray[np.float64],
    toward: NDArray[np.float64],
    resolution: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Where a ray enters and leaves cells (n, 3), m along it, (n,); it misses if not in order.

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
