"""Compiled kernels of what moves: sets of cells, their connected parts, and confident space.

A set of cells is an array (m, 3) in lexical order without repetition, so that a cell is found by
halving. All kernels that call each other live in this file because a cached kernel is not
recompiled when another file changes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.maps._jit import kernel
from wayproof.maps.kernels.bricks import EDGE, EDGE_BITS

ALL = np.uint64(0xFFFFFFFFFFFFFFFF)
ONE = np.uint64(1)
TOP = np.uint64(63)


@kernel
def locate(cells: NDArray[np.int64], x: int, y: int, z: int) -> int:
    """The place of a cell in a set (m, 3), or -1."""
    low, high = 0, cells.shape[0]
    while low < high:
        middle = (low + high) >> 1
        a, b, c = cells[middle, 0], cells[middle, 1], cells[middle, 2]
        if a < x or (a == x and (b < y or (b == y and c < z))):
            low = middle + 1
        else:
            high = middle
    if low < cells.shape[0] and cells[low, 0] == x and cells[low, 1] == y and cells[low, 2] == z:
        return low
    return -1


@kernel
def locate_all(
    cells: NDArray[np.int64],  # (m, 3) a set
    wanted: NDArray[np.int64],  # (n, 3)
    places: NDArray[np.int64],  # (n,) out: -1 where the set has no such cell
) -> None:
    """The places of cells in a set."""
    for i in range(wanted.shape[0]):
        places[i] = locate(cells, wanted[i, 0], wanted[i, 1], wanted[i, 2])


@kernel
def root_of(parents: NDArray[np.int64], i: int) -> int:
    """The root of a node; the way to it is halved on the way."""
    while parents[i] != i:
        parents[i] = parents[parents[i]]
        i = int(parents[i])
    return i


@kernel
def label_parts(
    cells: NDArray[np.int64],  # (m, 3) a set
    labels: NDArray[np.int64],  # (m,) out
) -> int:
    """Number the parts of a set whose cells lie near one another; return how many.

    Two cells are near with at most one cell between them: beams that spread leave such gaps.
    Union-find with path halving (Tarjan & van Leeuwen 1984). The root of a part is its least cell,
    so parts are numbered in the order of their least cells.
    """
    count = cells.shape[0]
    parents = np.arange(count)
    for i in range(count):
        x, y, z = cells[i, 0], cells[i, 1], cells[i, 2]
        for n in range(62):  # of the 124 cells nearby those that come before
            j = locate(cells, x - 2 + n // 25, y - 2 + n // 5 % 5, z - 2 + n % 5)
            if j >= 0:
                a, b = root_of(parents, i), root_of(parents, j)
                parents[max(a, b)] = min(a, b)
    parts = 0
    for i in range(count):
        root = root_of(parents, i)
        if root == i:
            labels[i] = parts
            parts += 1
        else:
            labels[i] = labels[root]
    return parts


@kernel
def shrink(
    planes: NDArray[np.uint64],  # (slots, 256)
    around: NDArray[np.int64],  # (k, 3, 3, 3) slots of a brick and its neighbours; -1: none
    shrunk: NDArray[np.uint64],  # (k, 256) out
) -> None:
    """The cells of bricks that are set together with all of their 26 neighbours."""
    for i in range(around.shape[0]):
        for x in range(EDGE):
            for y in range(EDGE):
                kept = ALL
                for near_x in range(x - 1, x + 2):
                    for near_y in range(y - 1, y + 2):
                        stack = around[i, 1 + (near_x >> EDGE_BITS), 1 + (near_y >> EDGE_BITS)]
                        column = ((near_x & (EDGE - 1)) << EDGE_BITS) + (near_y & (EDGE - 1))
                        word = planes[stack[1], column] if stack[1] >= 0 else np.uint64(0)
                        below = planes[stack[0], column] >> TOP if stack[0] >= 0 else np.uint64(0)
                        above = planes[stack[2], column] << TOP if stack[2] >= 0 else np.uint64(0)
                        kept &= word & ((word << ONE) | below) & ((word >> ONE) | above)
                shrunk[i, (x << EDGE_BITS) + y] = kept


@kernel
def lay_over(
    low: tuple[int, int, int],  # least cell of the window
    cells: NDArray[np.int64],  # (m, 3)
    only_set: bool,  # move only bits that `source` has
    source: NDArray[np.uint64],  # (nx, ny, words) loses the cells
    target: NDArray[np.uint64],  # (nx, ny, words) gains them
) -> None:
    """Move the bits of cells from one plane of a window to another."""
    nx, ny, words = source.shape
    for i in range(cells.shape[0]):
        x, y, z = cells[i, 0] - low[0], cells[i, 1] - low[1], cells[i, 2] - low[2]
        if 0 <= x < nx and 0 <= y < ny and 0 <= z < 64 * words:
            bit = ONE << np.uint64(z & 63)
            if not only_set or source[x, y, z >> 6] & bit != 0:
                source[x, y, z >> 6] &= ~bit
                target[x, y, z >> 6] |= bit
