"""Indices of bricks: which brick a cell lies in, and which cells lie in a brick."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.kernels.bricks import BELOW_FLOOR, EDGE, EDGE_BITS, HEIGHT

BRICK_SHAPE = EDGE, EDGE, HEIGHT
"""Cells of a brick along x, y and z."""

BELOW = 0, 0, BELOW_FLOOR
"""Layers of the lowest bricks that lie below cell 0."""

BITS = EDGE_BITS, EDGE_BITS, 6
"""Bits of a cell's place in its brick, along each axis."""


def brick_of(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the indices of the bricks that cells (..., 3) lie in."""
    found: NDArray[np.int64] = (cells + np.array(BELOW)) >> np.array(BITS)
    return found


def place_in_brick(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the indices (n,) of cells (n, 3) among the cells of their bricks."""
    x, y, z = ((cells + np.array(BELOW)) & (np.array(BRICK_SHAPE) - 1)).T
    place: NDArray[np.int64] = (x * EDGE + y) * HEIGHT + z
    return place


def brick_cells(keys: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return the least cells (..., 3) of bricks (..., 3)."""
    low: NDArray[np.int64] = keys.astype(np.int64) * BRICK_SHAPE - BELOW
    return low


def brick_boxes(keys: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return the boxes of cells (k, 6) of bricks (k, 3)."""
    low = brick_cells(keys)
    return np.hstack([low, low + BRICK_SHAPE])
