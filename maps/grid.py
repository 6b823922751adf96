"""The geometry of the cells: cubes over all space, and the cells of a point or a box."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

FLOOR_HEIGHT_IN_CELL = 0.75
"""Height of the plane z = 0 in its layer of cells, from the layer's bottom, in cells.

On a face, a millimetre of noise would throw the floor's returns into either of two layers. High in
the cell rather than in its middle, a grazing beam is in the floor's layer for a short stretch only.
"""

FLOOR_LAYER = 0
"""Index along z of the layer that holds the plane z = 0."""

MAX_COORDINATE = 1e6  # m
ROUNDING = 1e-6  # of a cell: an extent of 0.3 m holds three cells of 0.1 m

_SHIFT = np.array([0.0, 0.0, FLOOR_HEIGHT_IN_CELL])


def cells_at(points: ArrayLike, resolution: float) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return cells of points: floor(x / resolution), and along z floor(z / resolution + 0.75).

    Args:
        points: (n, 3) m, world.
        resolution: Edge of a cell, m.

    Returns:
        Indices (n, 3), and whether each point is finite and within 1000 km (n,); if not, its cell
        is 0.
    """
    positions = np.asarray(points, np.float64)
    inside = np.all(np.abs(positions) <= MAX_COORDINATE, axis=1)  # false for NaN
    cells = np.floor(np.where(inside[:, None], positions, 0.0) / resolution + _SHIFT)
    return cells.astype(np.int64), inside


def cell_box(
    low: ArrayLike, high: ArrayLike, resolution: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return cells whose centres lie in a box.

    Args:
        low: (3,) least corner, m, world.
        high: (3,) greatest corner, m, world.
        resolution: Edge of a cell, m.

    Returns:
        The first cell (3,) and one past the last (3,), never before the first.

    Raises:
        ValueError: A corner is not finite and within 1000 km.
    """
    least, greatest = finite_vector("low", low), finite_vector("high", high)
    first = np.ceil(least / resolution + _SHIFT - 0.5).astype(np.int64)
    last = np.floor(greatest / resolution + _SHIFT - 0.5).astype(np.int64)
    return first, np.maximum(last + 1, first)


def centres(cells: NDArray[np.int64], resolution: float) -> NDArray[np.float64]:
    """Return centres of cells (n, 3), m, world: (n, 3)."""
    middles: NDArray[np.float64] = (cells + 0.5 - _SHIFT) * resolution
    return middles


def finite_vector(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return a fresh (3,) float64 copy of a position.

    Raises:
        ValueError: It has another shape, or is not finite and within 1000 km.
    """
    vector = np.array(value, np.float64)
    if vector.shape != (3,) or not np.all(np.abs(vector) <= MAX_COORDINATE):
        raise ValueError(f"{name}: got {value!r}, expected 3 finite coordinates within 1e6 m")
    return vector
