"""Compiled kernels of the costmap: columns projected to the ground, and queries at points.

All of them live in this file because a cached kernel is not recompiled when another file changes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from maps._jit import kernel

WORD_BITS = 64


@kernel
def project_columns(
    occupied: NDArray[np.uint64],  # (kx, ky, words) along z
    free: NDArray[np.uint64],  # (kx, ky, words)
    below: NDArray[np.uint64],  # (words,) layers under the floor
    footing: NDArray[np.uint64],  # (words,) those that can be stood on: the floor and steps
    band: NDArray[np.uint64],  # (words,) those that the body passes through
    x0: int,
    y0: int,
    occupied_columns: NDArray[np.uint64],  # (nx, words) along y, in, out
    free_columns: NDArray[np.uint64],  # (nx, words) in, out
) -> None:
    """The state of each column of cells for a body that walks on the floor."""
    columns_x, columns_y, words = occupied.shape
    nothing = np.uint64(0)
    for i in range(columns_x):
        for k in range(columns_y):
            blocking = standing = closed = nothing
            for w in range(words):
                # A beam that went through where the floor should be found a hole.
                blocking |= (occupied[i, k, w] & band[w]) | (free[i, k, w] & below[w])
                standing |= occupied[i, k, w] & footing[w]
                closed |= band[w] & ~free[i, k, w]
            y = y0 + k
            word, bit = y // WORD_BITS, np.uint64(1) << np.uint64(y % WORD_BITS)
            occupied_columns[x0 + i, word] &= ~bit
            free_columns[x0 + i, word] &= ~bit
            if blocking != nothing:
                occupied_columns[x0 + i, word] |= bit
            elif standing != nothing and closed == nothing:
                free_columns[x0 + i, word] |= bit


@kernel
def look_up(
    points: NDArray[np.float64],  # (n, 3) m, world
    origin: NDArray[np.float64],  # (3,) m, world
    resolution: float,
    squared: NDArray[np.uint16],  # (nx, ny, nz)
    table: NDArray[np.float64],  # by squared distance
    values: NDArray[np.float64],  # (n,) out
) -> None:
    """The table's value at the cell of each point; that of distance 0 outside."""
    nx, ny, nz = squared.shape
    for n in range(points.shape[0]):
        u = (points[n, 0] - origin[0]) / resolution  # in cells from the window's corner
        v = (points[n, 1] - origin[1]) / resolution
        w = (points[n, 2] - origin[2]) / resolution
        values[n] = table[0]
        if 0.0 <= u < nx and 0.0 <= v < ny and 0.0 <= w < nz:  # not if not finite
            values[n] = table[squared[int(u), int(v), int(w)]]


@kernel
def distance_at(
    squared: NDArray[np.uint16],  # (nx, ny, nz)
    table: NDArray[np.float64],  # m, by squared distance
    x: int,
    y: int,
    z: int,
) -> float:
    """The distance at a cell: 0 outside; an axis of one cell does not count."""
    nx, ny, nz = squared.shape
    x, y, z = (x if nx > 1 else 0), (y if ny > 1 else 0), (z if nz > 1 else 0)
    if 0 <= x < nx and 0 <= y < ny and 0 <= z < nz:
        return float(table[squared[x, y, z]])
    return 0.0


@kernel
def interpolate(
    points: NDArray[np.float64],  # (n, 3) m, world
    origin: NDArray[np.float64],  # (3,) m, world
    resolution: float,
    squared: NDArray[np.uint16],  # (nx, ny, nz)
    table: NDArray[np.float64],  # m, by squared distance
    distances: NDArray[np.float64],  # (n,) out, m
    gradients: NDArray[np.float64],  # (n, 3) out, m/m
) -> None:
    """Trilinear interpolation between cell centres, and its exact gradient; 0 outside."""
    nx, ny, nz = squared.shape
    for n in range(points.shape[0]):
        u = (points[n, 0] - origin[0]) / resolution  # in cells from the window's corner
        v = (points[n, 1] - origin[1]) / resolution
        w = (points[n, 2] - origin[2]) / resolution
        distances[n] = gradients[n, 0] = gradients[n, 1] = gradients[n, 2] = 0.0
        if not (0.0 <= u < nx and 0.0 <= v < ny and 0.0 <= w < nz):  # also if not finite
            continue
        x, y, z = int(np.floor(u - 0.5)), int(np.floor(v - 0.5)), int(np.floor(w - 0.5))
        u, v, w = u - 0.5 - x, v - 0.5 - y, w - 0.5 - z  # shares of the next cell
        a = distance_at(squared, table, x, y, z)
        b = distance_at(squared, table, x, y, z + 1)
        c = distance_at(squared, table, x, y + 1, z)
        d = distance_at(squared, table, x, y + 1, z + 1)
        # What each grows by towards the next cell along x.
        da = distance_at(squared, table, x + 1, y, z) - a
        db = distance_at(squared, table, x + 1, y, z + 1) - b
        dc = distance_at(squared, table, x + 1, y + 1, z) - c
        dd = distance_at(squared, table, x + 1, y + 1, z + 1) - d
        a, b, c, d = a + u * da, b + u * db, c + u * dc, d + u * dd
        along_y = (1.0 - w) * (c - a) + w * (d - b)
        distances[n] = (1.0 - w) * a + w * b + v * along_y
        gradients[n, 0] = (
            (1.0 - v) * ((1.0 - w) * da + w * db) + v * ((1.0 - w) * dc + w * dd)
        ) / resolution
        gradients[n, 1] = along_y / resolution
        gradients[n, 2] = ((1.0 - v) * (b - a) + v * (d - c)) / resolution
