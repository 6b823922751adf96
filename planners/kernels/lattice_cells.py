"""A coarse lattice over a distance field: its cells, their cost rates, and moves between them.

A lattice cell is a block of grid cells, entered at the centre of its middle one. A move leads
straight from one centre to a neighbour's; it always touches the same grid cells relative to where
it begins, and is free if all of them are. So gaps much narrower than a block are found.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel

UNSEEN = 0
"""Rate of a lattice cell that has not been looked up; 0, so that its memory is not yet written."""

BLOCKED = -1
"""Rate of a lattice cell that cannot be entered."""

FREE_RATE = 8
"""Rate of a cell with nothing near: the resolution of costs is an eighth of length."""

LARGEST_RATE = 64 * FREE_RATE
"""Largest rate: it bounds the queue."""

LARGEST_FACTOR = 4
"""Largest number of grid cells to a lattice cell, along an axis."""

NEW, OPEN, CLOSED = 0, 1, 2
"""States of a lattice cell."""

KEY, OPENED, EXPANDED = 0, 1, 2
"""Indices of `Lattice.counters`."""

Indices = tuple[int, int, int]
"""Indices of a lattice cell, counted with the border."""

Bytes = NDArray[np.uint8]
Integers = NDArray[np.int32]
Longs = NDArray[np.int64]


class Rates(NamedTuple):
    """Cost per length of a grid cell."""

    price: NDArray[np.uint8]  # (nx, ny, nz) index of a cell's price; 0: its cost is by distance
    by_distance: Integers  # (t,) by squared distance
    by_price: Integers  # (p,)


class Lattice(NamedTuple):
    """A lattice over a distance field and the state of one search on it.

    The arrays by cell are flat and have a border of one blocked cell all around.
    """

    field: NDArray[np.uint16]  # (nx, ny, nz) squared cell distances
    cells: NDArray[np.uint16]  # (nx * ny * nz,) the same, flat
    threshold: int  # a grid cell is forbidden at or below it
    factor: Longs  # (3,) grid cells to a lattice cell
    shape: Longs  # (3,) lattice cells, border included
    rates: Rates
    moves: Longs  # (m, 3) to the neighbours
    move_offsets: Longs  # (m,) flat offsets to them
    move_lengths: Integers  # (m,)
    touched: Longs  # (m, k) flat offsets of the grid cells that each move touches
    touched_counts: Longs  # (m,) how many they are
    rate: Integers  # (n,) cost per length, UNSEEN or BLOCKED
    state: Bytes  # (n,)
    cost: Integers  # (n,) cost-to-go of an open or closed cell
    parent_move: Bytes  # (n,) move that leads to the cell from its successor towards the goal
    key: Integers  # (n,) of an open cell: its cost and the heuristic
    head: Integers  # (b,) first cell of each bucket of the queue
    after: Integers  # (n,) next cell in the same bucket
    before: Integers  # (n,) previous cell in the same bucket
    column_bound: Integers  # (columns,) least cost from a column to the target
    counters: Longs  # (3,) key in progress, open cells, expansions


@kernel
def unravel(shape: Longs, cell: int) -> Indices:
    """Return the indices of a lattice cell."""
    column = cell // shape[2]
    return column // shape[1], column % shape[1], cell - column * shape[2]


@kernel
def in_border(shape: Longs, indices: Indices) -> bool:
    """Return whether a lattice cell lies in the border."""
    i, j, k = indices
    outer = i == 0 or j == 0 or k == 0
    return bool(outer or i == shape[0] - 1 or j == shape[1] - 1 or k == shape[2] - 1)


@kernel
def middle_cell(factor: Longs, indices: Indices) -> Indices:
    """Return the grid cell in the middle of a lattice cell that is not in the border."""
    i, j, k = indices
    x, y, z = (i - 1) * factor[0], (j - 1) * factor[1], (k - 1) * factor[2]
    return x + (factor[0] >> 1), y + (factor[1] >> 1), z + (factor[2] >> 1)


@kernel
def middle_index(field: NDArray[np.uint16], factor: Longs, indices: Indices) -> int:
    """Return the flat index of the grid cell in the middle of a lattice cell."""
    x, y, z = middle_cell(factor, indices)
    return int((x * field.shape[1] + y) * field.shape[2] + z)


@kernel
def rate_at(rates: Rates, value: int, x: int, y: int, z: int) -> int:
    """Return the rate of a free grid cell with a squared distance."""
    price = rates.price[np.uint64(x), np.uint64(y), np.uint64(z)]
    if price > 0:
        return int(rates.by_price[price])
    return int(rates.by_distance[np.uint64(min(value, len(rates.by_distance) - 1))])


@kernel
def middle_rate(
    field: NDArray[np.uint16],
    threshold: int,
    factor: Longs,
    shape: Longs,
    rates: Rates,
    indices: Indices,
) -> int:
    """Return the rate of a lattice cell by its middle grid cell."""
    if in_border(shape, indices):
        return BLOCKED
    x, y, z = middle_cell(factor, indices)
    value = int(field[np.uint64(x), np.uint64(y), np.uint64(z)])
    if value <= threshold:
        return BLOCKED
    return rate_at(rates, value, x, y, z)


@kernel
def rate_of(lattice: Lattice, cell: int) -> int:
    """Return the rate of a lattice cell; the first call looks it up."""
    field, threshold, factor = lattice.field, lattice.threshold, lattice.factor
    if lattice.rate[cell] == UNSEEN:
        indices = unravel(lattice.shape, cell)
        lattice.rate[cell] = middle_rate(
            field, threshold, factor, lattice.shape, lattice.rates, indices
        )
    rate: int = lattice.rate[cell]
    return rate


@kernel
def move_free(
    cells: NDArray[np.uint16], threshold: int, index: int, touched: Longs, counts: Longs, move: int
) -> bool:
    """Return whether all grid cells that a move from a grid cell touches are free.

    The tables are passed whole: a row of one would have its references counted.
    """
    for n in range(np.uint64(counts[move])):
        if cells[np.uint64(index + touched[move, n])] <= threshold:
            return False
    return True
