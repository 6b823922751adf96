"""Boxes that cover the cells of a map, merged along rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.maps import Representation
from wayproof.maps.columns import WORD_BITS, Window, unpack

Array = NDArray[np.float64]


def flat_boxes(cells: NDArray[np.bool_], origin: Array, resolution: float) -> tuple[Array, Array]:
    """Return centres and half sizes (n, 2), m, of rows along x that cover cells (nx, ny)."""
    rows, first, end = runs(cells.T)
    middle = np.stack([0.5 * (first + end), rows + 0.5], axis=1)
    half = np.stack([0.5 * (end - first), np.full(len(rows), 0.5)], axis=1)
    return origin[:2] + resolution * middle, resolution * half


def surrounding_boxes(
    shape: tuple[int, ...], origin: Array, resolution: float, reach: float
) -> tuple[Array, Array]:
    """Return centres and half sizes (4, 2), m, of boxes around a map (nx, ny), `reach` m wide."""
    low, high = origin[:2], origin[:2] + resolution * np.array(shape[:2])
    lows = np.array(
        [
            [low[0] - reach, low[1] - reach],  # left and right, from end to end
            [high[0], low[1] - reach],
            [low[0], low[1] - reach],  # below and above, between them
            [low[0], high[1]],
        ]
    )
    highs = np.array(
        [
            [low[0], high[1] + reach],
            [high[0] + reach, high[1] + reach],
            [high[0], low[1]],
            [high[0], high[1] + reach],
        ]
    )
    return 0.5 * (lows + highs), 0.5 * (highs - lows)


def upright_boxes(a_map: Representation, low: ArrayLike, high: ArrayLike) -> tuple[Array, Array]:
    """Return centres and half sizes (n, 3), m, of occupied cells in a box, merged along columns.

    The layer of the floor is left out.
    """
    window = Window.covering(low, high, a_map.resolution)
    window = window.layers(max(window.floor_layer + 1, 0), window.shape[2])
    nx, ny, nz = window.shape
    occupied, _ = a_map.columns(window.first, (nx, ny, -(-nz // WORD_BITS)))
    columns, first, end = runs(unpack(occupied, nz).reshape(nx * ny, nz) > 0)
    x, y = np.divmod(columns, ny)
    middle = np.stack([x + 0.5, y + 0.5, 0.5 * (first + end)], axis=1)
    half = np.stack([np.full(len(x), 0.5), np.full(len(x), 0.5), 0.5 * (end - first)], axis=1)
    return window.origin + a_map.resolution * middle, a_map.resolution * half


def runs(
    rows: NDArray[np.bool_],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return the runs of true in each row of (n, k): row, first index, and index past the last."""
    padded = np.pad(rows.astype(np.int8), ((0, 0), (1, 1)))
    steps = np.diff(padded, axis=1)
    row, first = np.nonzero(steps == 1)
    _, end = np.nonzero(steps == -1)
    return row, first, end
