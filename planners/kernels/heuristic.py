"""Lower bounds of the cost between cells of a lattice: octile distance, and a search by columns."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import allocating, kernel
from wayproof.planners.kernels.bucket_queue import bucket_of, insert, remove
from wayproof.planners.kernels.lattice_cells import (
    BLOCKED,
    FREE_RATE,
    LARGEST_RATE,
    UNSEEN,
    Indices,
    Integers,
    Lattice,
    Longs,
    Rates,
    in_border,
    middle_cell,
    rate_at,
    unravel,
)

STEPS = (12, 17, 21)
"""Length of a move along one, two and three axes: 1, 2^0.5 and 3^0.5 to 1 %, in twelfths."""

UNKNOWN_COST = 2**30
"""Cost of a column that was not reached."""


@kernel
def octile_cost(x: int, y: int, z: int) -> int:
    """Return the cost of a displacement in cells along the axes, if all are free."""
    x, y, z = abs(x), abs(y), abs(z)
    most, least = max(x, y, z), min(x, y, z)
    middle = x + y + z - most - least
    length = STEPS[2] * least + STEPS[1] * (middle - least) + STEPS[0] * (most - middle)
    cost: int = 2 * FREE_RATE * length
    return cost


@kernel
def heuristic_between(shape: Longs, column_bound: Integers, a: Indices, b: Indices) -> int:
    """Return a lower bound of the cost from `a` to `b`: octile, or that of the column of `a`."""
    rest = octile_cost(a[0] - b[0], a[1] - b[1], a[2] - b[2])
    return max(rest, int(column_bound[np.uint64(a[0] * shape[1] + a[1])]))


@kernel
def heuristic(lattice: Lattice, cell: int, target: int) -> int:
    """Return a lower bound of the cost from a cell to the target; 0 for no target, -1."""
    if target < 0:
        return 0
    a, b = unravel(lattice.shape, cell), unravel(lattice.shape, target)
    return heuristic_between(lattice.shape, lattice.column_bound, a, b)


@kernel
def column_rate(
    field: NDArray[np.uint16],
    threshold: int,
    factor: Longs,
    shape: Longs,
    rates: Rates,
    i: int,
    j: int,
) -> int:
    """Return the least rate of a column's lattice cells, `BLOCKED` if none is free."""
    least = LARGEST_RATE + 1
    if in_border(shape, (i, j, 1)):
        return BLOCKED
    x, y, z = middle_cell(factor, (i, j, 1))
    row = field[np.uint64(x), np.uint64(y)]
    for at in range(np.uint64(z), np.uint64(len(row)), np.uint64(factor[2])):
        value = int(row[at])
        if value > threshold:
            least = min(least, rate_at(rates, value, x, y, at))
    return least if least <= LARGEST_RATE else BLOCKED


@allocating
def bound_columns(lattice: Lattice, goal: int, target: int) -> bool:
    """Bound the cost from each column of the lattice to the target, by a search in the plane.

    Where each column is as cheap as its cheapest cell, and up and down cost nothing, a way in the
    plane costs no more than any way above it (an abstraction of the search, after Holte et al.,
    "Hierarchical A*", AAAI 1996). The plane is searched from the target's column until the goal's
    is closed. The bound of a closed column is its cost, that of another the least that it still can
    be. So the bound is consistent: it falls by no more than the cost of each move.

    Args:
        lattice: Lattice in space; `column_bound` is written.
        goal: Cell where the search of the lattice begins.
        target: Cell where it ends.

    Returns:
        Whether there is a way in the plane; without one there is none in space.
    """
    field, threshold, factor = lattice.field, lattice.threshold, lattice.factor
    shape, rates = lattice.shape, lattice.rates
    head = np.full_like(lattice.head, -1)
    columns, begin, end = shape[0] * shape[1], target // shape[2], goal // shape[2]
    x, y = end // shape[1], end % shape[1]
    rate, cost = np.zeros(columns, np.int32), np.full(columns, UNKNOWN_COST, np.int32)
    closed = np.zeros(columns, np.bool_)
    keys, after, before = np.empty_like(cost), np.empty_like(cost), np.empty_like(cost)
    i, j = begin // shape[1], begin % shape[1]
    rate[begin], cost[begin] = column_rate(field, threshold, factor, shape, rates, i, j), 0
    key, opened = octile_cost(i - x, j - y, 0), 1
    insert(head, after, before, keys, begin, key)
    while opened > 0 and not closed[end]:
        column = int(head[bucket_of(head, key)])
        if column < 0:
            key += 1
            continue
        remove(head, after, before, keys, column)
        closed[column] = True
        opened -= 1
        i, j = column // shape[1], column % shape[1]
        for a in range(i - 1, i + 2):
            for b in range(j - 1, j + 2):
                other = a * shape[1] + b
                if closed[other]:
                    continue
                if rate[other] == UNSEEN:
                    rate[other] = column_rate(field, threshold, factor, shape, rates, a, b)
                if rate[other] < 0:
                    continue
                step = STEPS[0] if a == i or b == j else STEPS[1]
                through = cost[column] + step * (rate[column] + rate[other])
                if through >= cost[other]:
                    continue
                if cost[other] < UNKNOWN_COST:
                    remove(head, after, before, keys, other)
                    opened -= 1
                cost[other] = through
                insert(head, after, before, keys, other, through + octile_cost(a - x, b - y, 0))
                opened += 1
    for column in range(columns):
        still_open = key - octile_cost(column // shape[1] - x, column % shape[1] - y, 0)
        lattice.column_bound[column] = cost[column] if closed[column] else max(still_open, 0)
    return bool(closed[end])
