"""Kernels of moving objects: sets of cells, their connected components, and erosion of free space.

A set of cells is an array (m, 3) in lexical order without repetition, so that a cell is found by
binary search.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import allocating, kernel
from wayproof.maps.kernels.bricks import EDGE, EDGE_BITS

ALL = np.uint64(0xFFFFFFFFFFFFFFFF)
ONE = np.uint64(1)
TOP = np.uint64(63)


@kernel
def find_index(cells: NDArray[np.int64], x: int, y: int, z: int) -> int:
    """Find the index of a cell in a set (m, 3), or -1."""
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
def find_indices(
    cells: NDArray[np.int64],  # (m, 3) a set
    queries: NDArray[np.int64],  # (n, 3) cells
    indices: NDArray[np.int64],  # (n,) out: -1 where the set has no such cell
) -> None:
    """Find the indices of cells in a set."""
    for i in range(queries.shape[0]):
        indices[i] = find_index(cells, queries[i, 0], queries[i, 1], queries[i, 2])


@kernel
def find_root(parents: NDArray[np.int64], i: int) -> int:
    """Find the root of a node; the path to it is halved on the way."""
    while parents[i] != i:
        parents[i] = parents[parents[i]]
        i = int(parents[i])
    return i


@allocating
def label_components(
    cells: NDArray[np.int64],  # (m, 3) a set
    labels: NDArray[np.int64],  # (m,) out
) -> int:
    """Label the connected components of a set; return their number.

    Two cells are connected with at most one cell between them: beams that spread leave such gaps.
    Union-find with path halving (Tarjan & van Leeuwen 1984). The root of a component is its least
    cell, so components are numbered in the order of their least cells.
    """
    count = cells.shape[0]
    # Unite each cell with those before it that are near.
    parents = np.arange(count)
    for i in range(count):
        x, y, z = cells[i, 0], cells[i, 1], cells[i, 2]
        for n in range(62):  # of the 124 cells nearby those that come before
            j = find_index(cells, x - 2 + n // 25, y - 2 + n // 5 % 5, z - 2 + n % 5)
            if j >= 0:
                a, b = find_root(parents, i), find_root(parents, j)
                parents[max(a, b)] = min(a, b)
    # Number the roots; all other cells come after theirs.
    components = 0
    for i in range(count):
        root = find_root(parents, i)
        if root == i:
            labels[i] = components
            components += 1
        else:
            labels[i] = labels[root]
    return components


@kernel
def erode(
    columns: NDArray[np.uint64],  # (slots, 256) bits of bricks
    around: NDArray[np.int64],  # (k, 3, 3, 3) slots of a brick and its neighbours; -1: none
    eroded: NDArray[np.uint64],  # (k, 256) out
) -> None:
    """Find the cells of bricks that are set together with all of their 26 neighbours."""
    for i in range(around.shape[0]):
        for x in range(EDGE):
            for y in range(EDGE):
                kept = ALL
                for near_x in range(x - 1, x + 2):
                    for near_y in range(y - 1, y + 2):
                        # The column beside, with the bits that cross over from those above, below.
                        stack = around[i, 1 + (near_x >> EDGE_BITS), 1 + (near_y >> EDGE_BITS)]
                        column = ((near_x & (EDGE - 1)) << EDGE_BITS) + (near_y & (EDGE - 1))
                        word = columns[stack[1], column] if stack[1] >= 0 else np.uint64(0)
                        below = columns[stack[0], column] >> TOP if stack[0] >= 0 else np.uint64(0)
                        above = columns[stack[2], column] << TOP if stack[2] >= 0 else np.uint64(0)
                        kept &= word & ((word << ONE) | below) & ((word >> ONE) | above)
                eroded[i, (x << EDGE_BITS) + y] = kept


@kernel
def move_bits(
    low: tuple[int, int, int],  # least cell of the window
    cells: NDArray[np.int64],  # (m, 3)
    only_set: bool,  # move only bits that `source` has
    source: NDArray[np.uint64],  # (nx, ny, words) loses the cells
    target: NDArray[np.uint64],  # (nx, ny, words) gains them
) -> None:
    """Move the bits of cells from one mask of a window to another."""
    nx, ny, words = source.shape
    for i in range(cells.shape[0]):
        x, y, z = cells[i, 0] - low[0], cells[i, 1] - low[1], cells[i, 2] - low[2]
        if 0 <= x < nx and 0 <= y < ny and 0 <= z < 64 * words:
            bit = ONE << np.uint64(z & 63)
            if not only_set or source[x, y, z >> 6] & bit != 0:
                source[x, y, z >> 6] &= ~bit
                target[x, y, z >> 6] |= bit
