"""Repair of a lattice's costs-to-go where the distance field has changed.

After Ramalingam and Reps, "An Incremental Algorithm for a Generalization of the Shortest-Path
Problem", Journal of Algorithms 1996.
"""

from __future__ import annotations

import numpy as np

from wayproof.maps._jit import allocating
from wayproof.planners.kernels.lattice_cells import (
    CLOSED,
    INVALID,
    NEW,
    OPEN,
    UNSEEN,
    Integers,
    Lattice,
    Longs,
    block_mask,
    middle_rate,
)


@allocating
def refresh_box(lattice: Lattice, low: Longs, high: Longs) -> Integers:
    """Look the cells of a box up again that were looked up before; return those that changed."""
    field, threshold, factor = lattice.field, lattice.threshold, lattice.factor
    shape, seen, masks = lattice.shape, lattice.rate, lattice.mask
    changed = np.empty(len(seen), np.int32)
    count = 0
    for i in range(low[0], high[0]):
        for j in range(low[1], high[1]):
            for k in range(low[2], high[2]):
                cell = (i * shape[1] + j) * shape[2] + k
                if seen[cell] == UNSEEN:
                    continue
                indices = i, j, k
                rate = middle_rate(field, threshold, factor, shape, lattice.rates, indices)
                mask = block_mask(field, threshold, factor, shape, indices)
                if rate != seen[cell] or mask != masks[cell]:
                    seen[cell], masks[cell] = rate, mask
                    changed[count] = cell
                    count += 1
    return changed[:count].copy()


@allocating
def repair(lattice: Lattice, changed: Integers) -> None:
    """Reset the costs-to-go that a change can have altered, and reopen the cells around them.

    A change alters moves to, from and past its cell only, so the costs of its neighbours are reset,
    and of all cells whose way leads over one of those. The others are costs of ways that still
    exist; `expand` finds the cheaper ones. The goal's cost is never reset. The queue has to be made
    anew by `requeue`.

    Args:
        lattice: Its search.
        changed: Cells whose rate or mask has changed.
    """
    offsets, parent = lattice.move_offsets, lattice.parent_move
    state, cost = lattice.state, lattice.cost
    invalid = np.empty(len(state), np.int32)
    count, done = 0, 0
    for cell in changed:
        for move in range(-1, len(offsets)):
            near = cell if move < 0 else cell + offsets[move]
            if state[near] == INVALID or (state[near] != NEW and cost[near] == 0):
                continue
            state[near] = INVALID
            invalid[count] = near
            count += 1
    # Their descendants: the cells whose parent move comes from an invalid one.
    while done < count:
        cell = invalid[done]
        done += 1
        for move in range(len(offsets)):
            near = cell + offsets[move]
            if near < 0 or near >= len(state):
                continue  # beside a cell in the border
            if (state[near] != OPEN and state[near] != CLOSED) or parent[near] != move:
                continue
            if cost[near] == 0:
                continue
            state[near] = INVALID
            invalid[count] = near
            count += 1
    for cell in invalid[:count]:
        for offset in offsets:
            near = cell + offset
            if 0 <= near < len(state) and state[near] == CLOSED:
                state[near] = OPEN
        state[cell] = NEW
