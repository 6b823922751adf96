"""Kernels of the costmap: columns projected to the ground, and queries at points."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel

WORD_BITS = 64


class FlatLayers(NamedTuple):
    """Layers of a window, a bit each, as a body on a flat floor meets them.

    Attributes:
        below: (words,) those under the floor.
        footing: (words,) those that can be stood on: the floor and steps.
        band: (words,) those that the body passes through.
    """

    below: NDArray[np.uint64]
    footing: NDArray[np.uint64]
    band: NDArray[np.uint64]


@kernel
def touch(
    boxes: NDArray[np.int64],  # (k, 6) first cell and one past the last: x, y, z, x, y, z
    first: tuple[int, int, int],  # cell of a window
    shape: tuple[int, int, int],  # (nx, ny, nz) cells
    touching: NDArray[np.int64],  # (k, 6) out: those that hold any of its cells
    columns: NDArray[np.int64],  # (2, 2) out: columns that they hold, first and end along x and y
) -> int:
    """List the boxes that hold any cell of a window; return their number."""
    count = int(np.int64(0))
    columns[0, 0], columns[1, 0] = shape[0], shape[1]
    columns[0, 1] = columns[1, 1] = 0
    for k in range(boxes.shape[0]):
        inside = True
        for axis in range(3):
            low = max(boxes[k, axis], first[axis])
            inside &= low < min(boxes[k, 3 + axis], first[axis] + shape[axis])
        if not inside:
            continue
        for i in range(6):
            touching[count, i] = boxes[k, i]
        count += 1
        for axis in range(2):
            low, end = boxes[k, axis] - first[axis], boxes[k, 3 + axis] - first[axis]
            columns[axis, 0] = min(columns[axis, 0], max(low, 0))
            columns[axis, 1] = max(columns[axis, 1], min(end, shape[axis]))
    return count


@kernel
def is_hole(
    occupied: NDArray[np.uint64],  # (nx, ny, words) along z
    free: NDArray[np.uint64],  # (nx, ny, words)
    layers: FlatLayers,
    x: int,
    y: int,
) -> bool:
    """Return whether a beam went below the floor of a column, and no floor was seen there."""
    through = standing = np.uint64(0)
    for w in range(occupied.shape[2]):
        through |= free[x, y, w] & layers.below[w]
        standing |= occupied[x, y, w] & layers.footing[w]
    return bool(through != 0 and standing == 0)


@kernel
def is_edge(
    occupied: NDArray[np.uint64],  # (nx, ny, words) along z
    free: NDArray[np.uint64],  # (nx, ny, words)
    layers: FlatLayers,
    x: int,
    y: int,
) -> bool:
    """Return whether a column or one beside it, corners too, is a hole."""
    for i in range(max(x - 1, 0), min(x + 2, occupied.shape[0])):
        for j in range(max(y - 1, 0), min(y + 2, occupied.shape[1])):
            if is_hole(occupied, free, layers, i, j):
                return True
    return False


@kernel
def project_columns(
    occupied: NDArray[np.uint64],  # (nx, ny, words) along z
    free: NDArray[np.uint64],  # (nx, ny, words)
    layers: FlatLayers,
    part_x: tuple[int, int],  # first and one past the last of the columns to project
    part_y: tuple[int, int],
    occupied_columns: NDArray[np.uint64],  # (nx, words) along y, in, out
    free_columns: NDArray[np.uint64],  # (nx, words) in, out
) -> None:
    """Find the state of each column of cells for a body that walks on the floor.

    64 columns along y at a time, as one word of the result.
    """
    below, footing, band = layers
    words, nothing, one = occupied.shape[2], np.uint64(0), np.uint64(1)
    for x in range(part_x[0], part_x[1]):
        for word in range(part_y[0] // WORD_BITS, (part_y[1] - 1) // WORD_BITS + 1):
            first = max(part_y[0], word * WORD_BITS)
            end = min(part_y[1], (word + 1) * WORD_BITS)
            read_blocks = held = clear = nothing  # a bit for each column
            bit = one << np.uint64(first % WORD_BITS)
            for y in range(first, end):
                blocking = standing = closed = through = nothing
                for w in range(words):
                    blocking |= occupied[x, y, w] & band[w]
                    through |= free[x, y, w] & below[w]
                    standing |= occupied[x, y, w] & footing[w]
                    closed |= band[w] & ~free[x, y, w]
                read_blocks |= bit
                # A beam that went through where the floor should be found a hole; seen floor holds,
                # but at the edge of one.
                if through != nothing and is_edge(occupied, free, layers, x, y):
                    blocking = through
                if blocking != nothing:
                    held |= bit
                elif standing != nothing and closed == nothing:
                    clear |= bit
                bit <<= one
            occupied_columns[x, word] = (occupied_columns[x, word] & ~read_blocks) | held
            free_columns[x, word] = (free_columns[x, word] & ~read_blocks) | clear


@kernel
def neighbours(position: float, cells: int) -> tuple[int, int, float, float, float]:
    """Find the two cells along an axis whose centres enclose a position, and their weights.

    Args:
        position: Position in cells from the window's corner, within it.
        cells: Number of cells of the window along this axis.

    Returns:
        Both indices, clipped to the window; whether each is within it, 1 or 0; the second's weight.
        On an axis of one cell both are that cell.
    """
    first = int(np.floor(position - 0.5))
    share = position - 0.5 - first
    if cells == 1:
        return 0, 0, 1.0, 1.0, share
    before, after = max(first, 0), min(first + 1, cells - 1)
    return before, after, 1.0 * (before == first), 1.0 * (after == first + 1), share


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
    """Interpolate trilinearly between cell centres, with the exact gradient; 0 outside."""
    nx, ny, nz = squared.shape
    for n in range(points.shape[0]):
        u = (points[n, 0] - origin[0]) / resolution  # in cells from the window's corner
        v = (points[n, 1] - origin[1]) / resolution
        w = (points[n, 2] - origin[2]) / resolution
        distances[n] = gradients[n, 0] = gradients[n, 1] = gradients[n, 2] = 0.0
        if not (0.0 <= u < nx and 0.0 <= v < ny and 0.0 <= w < nz):  # also if not finite
            continue
        x, next_x, in_x, in_next_x, u = neighbours(u, nx)
        y, next_y, in_y, in_next_y, v = neighbours(v, ny)
        z, next_z, in_z, in_next_z, w = neighbours(w, nz)
        # At the window's border the outer cells are outside, at distance 0.
        a = table[squared[x, y, z]] * (in_x * in_y * in_z)
        b = table[squared[x, y, next_z]] * (in_x * in_y * in_next_z)
        c = table[squared[x, next_y, z]] * (in_x * in_next_y * in_z)
        d = table[squared[x, next_y, next_z]] * (in_x * in_next_y * in_next_z)
        # The growth of each towards the next cell along x.
        da = table[squared[next_x, y, z]] * (in_next_x * in_y * in_z) - a
        db = table[squared[next_x, y, next_z]] * (in_next_x * in_y * in_next_z) - b
        dc = table[squared[next_x, next_y, z]] * (in_next_x * in_next_y * in_z) - c
        dd = table[squared[next_x, next_y, next_z]] * (in_next_x * in_next_y * in_next_z) - d
        # Interpolated along x; then along z and y.
        a, b, c, d = a + u * da, b + u * db, c + u * dc, d + u * dd
        along_y = (1.0 - w) * (c - a) + w * (d - b)
        distances[n] = (1.0 - w) * a + w * b + v * along_y
        gradients[n, 0] = (
            (1.0 - v) * ((1.0 - w) * da + w * db) + v * ((1.0 - w) * dc + w * dd)
        ) / resolution
        gradients[n, 1] = along_y / resolution
        gradients[n, 2] = ((1.0 - v) * (b - a) + v * (d - c)) / resolution
