"""A* on a coarse lattice: exact integer costs-to-go, expanded from the goal.

Costs are integers, so the cost-to-go of a cell has one value, whatever the order of the search.
Hart, Nilsson, Raphael, "A Formal Basis for the Heuristic Determination of Minimum Cost Paths", IEEE
TSSC 1968.
"""

from __future__ import annotations

import numpy as np

from wayproof.kernel_compiler import allocating, kernel
from wayproof.planners.kernels.bucket_queue import bucket_of, insert, remove
from wayproof.planners.kernels.heuristic import heuristic, heuristic_between, octile_cost
from wayproof.planners.kernels.lattice_cells import (
    CLOSED,
    EXPANDED,
    KEY,
    NEW,
    OPEN,
    OPENED,
    UNSEEN,
    Integers,
    Lattice,
    Longs,
    middle_index,
    middle_rate,
    move_free,
    unravel,
)

UNKNOWN_KEY = 2**62
"""Key of an empty queue."""


@kernel
def open_cell(lattice: Lattice, cell: int, cost: int, key: int) -> None:
    """Open a cell: into the bucket of its key, last in, first out."""
    insert(lattice.head, lattice.after, lattice.before, lattice.key, cell, key)
    lattice.state[cell] = OPEN
    lattice.cost[cell] = cost
    lattice.counters[OPENED] += 1


@kernel
def expand(lattice: Lattice, until: int, target: int, budget: int, margin: int) -> bool:
    """Expand cells in the order of their keys until a given one is closed, and some beyond it.

    Args:
        lattice: Lattice with the open cells from which the search continues.
        until: The cell to close.
        target: Cell of the heuristic; -1 for none: then all cells nearer to the goal are closed
            before `until`.
        budget: Largest number of cells to expand.
        margin: Cells whose keys are below the cost of `until` and this are closed, too. From 1 on
            these are all cells of all its cheapest ways.

    Returns:
        Whether that is done; if not, the budget is spent or no cell is open.
    """
    # Arrays are taken out of the tuple once: inside the loop their references would be counted.
    field, threshold, cells = lattice.field, lattice.threshold, lattice.cells
    factor, shape, rates = lattice.factor, lattice.shape, lattice.rates
    moves, offsets, lengths = lattice.moves, lattice.move_offsets, lattice.move_lengths
    touched, counts, rate = lattice.touched, lattice.touched_counts, lattice.rate
    state, cost, parent = lattice.state, lattice.cost, lattice.parent_move
    head, after, before, keys = lattice.head, lattice.after, lattice.before, lattice.key
    key, opened, closed = lattice.counters[KEY], lattice.counters[OPENED], 0
    column_bound, aim = lattice.column_bound, unravel(shape, max(target, 0))
    while opened > 0 and closed < budget:
        if state[until] == CLOSED and key >= cost[until] + margin:
            break
        # The next cell of the least key; a bucket also holds keys of later rounds of the ring.
        cell = int(head[bucket_of(head, key)])
        while cell >= 0 and keys[np.uint64(cell)] != key:
            cell = int(after[np.uint64(cell)])
        if cell < 0:
            key += 1
            continue
        remove(head, after, before, keys, cell)
        here = np.uint64(cell)
        state[here] = CLOSED
        opened -= 1
        closed += 1
        i, j, k = unravel(shape, cell)
        index = middle_index(field, factor, (i, j, k))
        for move in range(np.uint64(len(offsets))):
            other = cell + offsets[move]
            at = np.uint64(other)
            indices = (i + moves[move, 0], j + moves[move, 1], k + moves[move, 2])
            if rate[at] == UNSEEN:
                rate[at] = middle_rate(field, threshold, factor, shape, rates, indices)
            if rate[at] < 0:
                continue
            through = cost[here] + lengths[move] * (rate[here] + rate[at])
            if state[at] != NEW and through >= cost[at]:
                continue
            if not move_free(cells, threshold, index, touched, counts, move):
                continue
            if state[at] == OPEN:
                remove(head, after, before, keys, other)
                opened -= 1
            rest = heuristic_between(shape, column_bound, indices, aim) if target >= 0 else 0
            insert(head, after, before, keys, other, through + rest)
            opened += 1
            state[at] = OPEN
            cost[at] = through
            parent[at] = move
    lattice.counters[KEY], lattice.counters[OPENED] = key, opened
    lattice.counters[EXPANDED] += closed
    return bool(state[until] == CLOSED and (opened == 0 or key >= cost[until] + margin))


@kernel
def requeue(lattice: Lattice, target: int, cells: Longs) -> None:
    """Queue all open cells again, for the heuristic of another target; -1 for none."""
    cost = lattice.cost
    head, after, before, keys = lattice.head, lattice.after, lattice.before, lattice.key
    head[:] = -1
    first = UNKNOWN_KEY
    for cell in cells:
        key = cost[cell] + heuristic(lattice, cell, target)
        insert(head, after, before, keys, cell, key)
        first = min(first, key)
    lattice.counters[KEY], lattice.counters[OPENED] = first, len(cells)


@allocating
def descend(lattice: Lattice, start: int) -> Integers:
    """Return the cells from a closed one down the costs-to-go to the goal; first move of equals.

    Only closed cells are followed, whose costs are exact: the cheapest path on the lattice.
    """
    field, threshold, factor = lattice.field, lattice.threshold, lattice.factor
    offsets, lengths, touched = lattice.move_offsets, lattice.move_lengths, lattice.touched
    rate, state, cost = lattice.rate, lattice.state, lattice.cost
    cells = np.empty(len(rate), np.int32)
    count, cell = 1, start
    cells[0] = start
    while cost[cell] > 0:
        index = middle_index(field, factor, unravel(lattice.shape, cell))
        for move in range(len(offsets)):
            other = cell + offsets[move]
            if state[other] != CLOSED:
                continue
            if cost[other] + lengths[move] * (rate[cell] + rate[other]) != cost[cell]:
                continue
            if move_free(lattice.cells, threshold, index, touched, lattice.touched_counts, move):
                cell = other
                break
        cells[count] = cell
        count += 1
    return cells[:count].copy()


@allocating
def bounds_to_go(lattice: Lattice, target: int, limit: int) -> Integers:
    """Return lower bounds (nodes,) of the cost from each cell of a plane to the goal.

    The cost-to-go of a cell if some way from the target over it to the goal costs at most the
    limit; of any other cell the least cost-to-go that exceeds the limit. So the bounds do not
    depend on which other cells are closed. Without the border, and halved: a move costs its length
    times the mean rate.

    Args:
        lattice: Lattice of a plane, with all cells closed whose keys are up to the limit.
        target: Cell of the heuristic.
        limit: Cost.
    """
    shape, state, cost = lattice.shape, lattice.state, lattice.cost
    rows, columns = shape[0] - 2, shape[1] - 2
    x, y = target // (shape[1] * shape[2]) - 1, target // shape[2] % shape[1] - 1
    bounds = np.empty(rows * columns, np.int32)
    for i in range(rows):
        for j in range(columns):
            cell = ((i + 1) * shape[1] + j + 1) * shape[2] + 1
            most = limit - octile_cost(i - x, j - y, 0)
            known = state[cell] == CLOSED and cost[cell] <= most
            bounds[i * columns + j] = (cost[cell] if known else max(most, 0)) >> 1
    return bounds
