"""A* over positions and headings, for a body that cannot turn everywhere.

A node is the centre of every `factor`-th grid cell along both axes; a state is a node and one of 16
headings: those of the moves to the neighbours and the knight's moves. The body lies along its
heading, nose or tail ahead. What each disc's centre touches on a step or a turn are always the same
cells relative to the node, so a check is a walk through a table. Costs are integers.

A* (Hart, Nilsson, Raphael, IEEE TSSC 1968) on a state lattice (Pivtoraiko, Knepper, Kelly, Journal
of Field Robotics 2009), its heuristic the costs-to-go of the least disc.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import allocating, kernel
from wayproof.planners.kernels.heap import pop, push

HEADINGS = 16
"""Number of headings of a node."""

UNKNOWN_COST = 2**30
"""Cost of a state that was not reached; sums of it and any cost stay below 2^31."""

STATE_BITS = 24
"""Lowest bits of a key, the state; the rest is the cost."""

NONE = -1
"""Index in place of a state or a slot."""

FIRST_ROOM = 4096
"""Number of keys that the heap has room for at first."""

EAGERNESS = 4
"""Binary logarithm of the share by which the heuristic is inflated, a sixteenth (weighted A*, Pohl,
Machine Intelligence 1970): a detour that the least disc did not need is found without expanding all
states that cost as little."""

Longs = NDArray[np.int64]
Integers = NDArray[np.int32]
Bools = NDArray[np.bool_]


class SweptCells(NamedTuple):
    """The cells that the centre of each disc touches on each of some motions, from a node."""

    cells: Longs  # (motions, discs, k, 2)
    counts: Longs  # (motions, discs) how many of the k
    middles: Longs  # (motions, discs, 2) the cell with the least distance to the farthest other
    reaches: Longs  # (motions, discs) distance from it along each axis, at most
    enough: Longs  # (motions, discs) squared distance there above which all cells are free


class Primitives(NamedTuple):
    """The motions of a state lattice: the cells that they touch, and their costs."""

    steps: Longs  # (16, 2) in nodes
    lengths: Longs  # (16,)
    stepped: SweptCells  # of a step ahead
    turned: SweptCells  # of a turn to the next heading to the left
    spun: SweptCells  # of a whole turn, the only motion
    turn_cost: int  # of a turn to the next heading
    reversal_cost: int  # of going on tail first, or nose first again


class Plane(NamedTuple):
    """A plane of cells and the nodes over it."""

    field: NDArray[np.uint16]  # (nx, ny) squared cell distances
    threshold: int
    price: NDArray[np.uint8]  # (nx, ny) index of a cell's price; 0: its cost is by distance
    rates: Integers  # (t,) cost per length by squared distance
    priced: Integers  # (p,) cost per length by price
    factor: int
    shape: tuple[int, int]  # nodes


class SeenNodes(NamedTuple):
    """The nodes that were reached, in the order in which they were: each has a slot.

    There is room for all, but memory that is not written is not used.
    """

    cost: Integers  # (k, 16) of a state; of a node where the body can spin only the first
    parent: Integers  # (k, 16) state before it, NONE of a start
    arrival: NDArray[np.uint8]  # (k, 16) heading by which it was reached
    can_spin: Bools  # (k,) whether the body can turn to any heading


@allocating
def search_states(
    plane: Plane,
    primitives: Primitives,
    to_go: Integers,
    starts: Longs,
    start_costs: Longs,
    goal: int,
    budget: int,
) -> tuple[Longs, Bools]:
    """Search states from a start to the goal's node, shape (n,); none within the budget: (0,).

    Where the body can spin it turns free of charge, so such a node is one state, not 16: the search
    follows the costs-to-go there, and is wide only where the body is not free.

    Args:
        plane: Cells and nodes.
        primitives: Motions.
        to_go: Estimate of the cost from each node to the goal, shape (nodes,).
        starts: States, shape (s,): a node times 16 and a heading.
        start_costs: Cost of each start, shape (s,).
        goal: Node.
        budget: Largest number of states to expand.

    Returns:
        The states, and at which of them the body can spin, shape (n,): such a node has two, as the
        body comes and as it leaves.
    """
    rows, columns = plane.shape
    half = plane.factor // 2
    # Arrays are taken out of the tuples once: inside the loop their references would be counted.
    steps, lengths = primitives.steps, primitives.lengths
    stepped, turned = primitives.stepped, primitives.turned
    slots = np.full(rows * columns, NONE, np.int32)  # node -> its slot
    seen = SeenNodes(
        np.empty((rows * columns, HEADINGS), np.int32),
        np.empty((rows * columns, HEADINGS), np.int32),
        np.empty((rows * columns, HEADINGS), np.uint8),
        np.empty(rows * columns, np.bool_),
    )
    cost, parent, arrival, can_spin = seen.cost, seen.parent, seen.arrival, seen.can_spin
    count = 0
    heap, queued = np.empty(FIRST_ROOM, np.int64), 0
    # Open the starts.
    for n in range(len(starts)):
        node, heading = starts[n] // HEADINGS, starts[n] % HEADINGS
        if slots[node] == NONE:
            i, j = node // columns, node % columns
            u, v = i * plane.factor + half, j * plane.factor + half
            open_slot(plane, primitives.spun, u, v, seen, count)
            slots[node] = count
            count += 1
        slot = slots[node]
        state = 0 if can_spin[slot] else heading
        if start_costs[n] < cost[slot, state]:
            cost[slot, state], parent[slot, state] = start_costs[n], NONE
            arrival[slot, state] = heading
            key = key_of(start_costs[n], to_go[node], node * HEADINGS + state)
            heap, queued = push(heap, queued, key), queued + 1
    while queued > 0 and budget > 0:
        queued -= 1
        key = pop(heap, queued)
        state = int(key & ((1 << STATE_BITS) - 1))
        node, heading = state // HEADINGS, state % HEADINGS
        slot = slots[node]
        known, rest = int(cost[slot, heading]), int(to_go[node])
        if key >> STATE_BITS > known + rest + (rest >> EAGERNESS):
            continue  # a cheaper way was found since it was queued
        if node == goal:
            return backtrack(slots, columns, seen, state)
        budget -= 1
        i, j = node // columns, node % columns
        u, v = i * plane.factor + half, j * plane.factor + half
        spins = can_spin[slot]
        if not spins:
            # Reverse, or turn to the next heading to the left or to the right.
            for motion in range(3):
                other = (heading + (HEADINGS // 2, 1, -1)[motion]) % HEADINGS
                extra = primitives.reversal_cost if motion == 0 else primitives.turn_cost
                if known + extra >= cost[slot, other]:
                    continue
                swept = other if motion == 2 else heading
                if motion > 0 and not motion_free(plane, u, v, turned, swept):
                    continue
                cost[slot, other], parent[slot, other] = known + extra, state
                arrival[slot, other] = other
                key = key_of(known + extra, rest, node * HEADINGS + other)
                heap, queued = push(heap, queued, key), queued + 1
        # Step ahead: along the heading, or where the body spins along any.
        here = rate_at(plane, u, v)
        for ahead in range(0 if spins else heading, HEADINGS if spins else heading + 1):
            x, y = i + int(steps[ahead, 0]), j + int(steps[ahead, 1])
            if x < 0 or y < 0 or x >= rows or y >= columns:
                continue
            other, p, q = x * columns + y, x * plane.factor + half, y * plane.factor + half
            found = known + (int(lengths[ahead]) * (here + rate_at(plane, p, q)) >> 1)
            at = slots[other]
            if at != NONE and found >= cost[at, 0 if can_spin[at] else ahead]:
                continue
            if not motion_free(plane, u, v, stepped, ahead):
                continue
            if at == NONE:
                open_slot(plane, primitives.spun, p, q, seen, count)
                at, slots[other] = count, count
                count += 1
            to = 0 if can_spin[at] else ahead
            cost[at, to], parent[at, to], arrival[at, to] = found, state, ahead
            key = key_of(found, to_go[other], other * HEADINGS + to)
            heap, queued = push(heap, queued, key), queued + 1
    return np.empty(0, np.int64), np.empty(0, np.bool_)


@kernel
def key_of(cost: int, rest: int, state: int) -> int:
    """Return the key of a state: the estimate of the whole cost, then the state."""
    return int(cost + rest + (rest >> EAGERNESS)) << STATE_BITS | int(state)


@kernel
def open_slot(plane: Plane, spun: SweptCells, u: int, v: int, seen: SeenNodes, slot: int) -> None:
    """Give a slot to a node in the middle of a grid cell: no state of it is reached."""
    seen.cost[slot] = UNKNOWN_COST
    seen.can_spin[slot] = motion_free(plane, u, v, spun, 0)


@kernel
def motion_free(plane: Plane, i: int, j: int, swept: SweptCells, motion: int) -> bool:
    """Return whether all cells that the discs touch on a motion from a grid cell are free.

    A distance falls by no more than the cells are apart, so where it is large enough in the middle
    of a disc's cells the others are not read.
    """
    nx, ny = plane.field.shape
    for disc in range(swept.counts.shape[1]):
        x, y = i + swept.middles[motion, disc, 0], j + swept.middles[motion, disc, 1]
        reach = swept.reaches[motion, disc]
        inside = x >= reach and y >= reach and x + reach < nx and y + reach < ny
        if inside and plane.field[x, y] > swept.enough[motion, disc]:
            continue
        for n in range(swept.counts[motion, disc]):
            x, y = i + swept.cells[motion, disc, n, 0], j + swept.cells[motion, disc, n, 1]
            if x < 0 or y < 0 or x >= nx or y >= ny or plane.field[x, y] <= plane.threshold:
                return False
    return True


@kernel
def rate_at(plane: Plane, i: int, j: int) -> int:
    """Return the cost per length at a grid cell."""
    if plane.price[i, j] > 0:
        return int(plane.priced[plane.price[i, j]])
    return int(plane.rates[min(int(plane.field[i, j]), len(plane.rates) - 1)])


@allocating
def backtrack(slots: Integers, columns: int, seen: SeenNodes, state: int) -> tuple[Longs, Bools]:
    """Return the states that led to one, from the first, and at which of them the body can spin.

    Of a node where it can there are two, as the body comes and as it leaves.
    """
    # Lists of numba need an element to have a type.
    states, spins = [np.int64(state)], [False]
    states.pop()
    spins.pop()
    at, leaves = state, NONE
    while at != NONE:
        node = at // HEADINGS
        slot, heading = slots[node], at % HEADINGS
        spin, arrives = bool(seen.can_spin[slot]), int(seen.arrival[slot, heading])
        if spin and leaves != NONE:
            states.append(np.int64(node * HEADINGS + leaves))
            spins.append(spin)
        states.append(np.int64(node * HEADINGS + arrives))
        spins.append(spin)
        before = int(seen.parent[slot, heading])
        leaves = arrives if before == NONE or before // HEADINGS != node else NONE
        at = before
    return np.array(states)[::-1].copy(), np.array(spins)[::-1].copy()


@kernel
def interpolate_bounds(nodes: Integers, factor: int, cells: Integers) -> None:
    """Interpolate bounds of nodes, each the middle of `factor` by `factor` cells, for every cell.

    The result counts a cell's length and not a node's. Beyond the outer nodes their bounds hold.
    """
    rows, columns = nodes.shape
    for i in range(cells.shape[0]):
        x, right = divmod(i - factor // 2, factor)
        low = min(max(x, 0), rows - 1)
        high = min(low + 1, rows - 1)
        y, up = divmod(-(factor // 2), factor)
        for j in range(cells.shape[1]):
            near = min(max(y, 0), columns - 1)
            far = min(near + 1, columns - 1)
            below = (factor - right) * int(nodes[low, near]) + right * int(nodes[high, near])
            above = (factor - right) * int(nodes[low, far]) + right * int(nodes[high, far])
            cells[i, j] = ((factor - up) * below + up * above) // factor
            y, up = (y + 1, 0) if up + 1 == factor else (y, up + 1)
