"""Kernels of the search over places and headings, for a body that cannot turn everywhere.

A node is the centre of every ``factor``-th grid cell along both axes; a state is a node and one of
16 ways: those to the neighbours and the knight's moves. The body lies along its way, nose or tail
ahead. What each disc's centre touches on a step or a turn are always the same cells relative to the
node, so a check is a walk through a table. Costs are integers.

A* (Hart, Nilsson, Raphael, IEEE TSSC 1968), drawn by the costs-to-go of the least disc, which the
search for its way found before.
"""

import heapq
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from planners._jit import kernel

WAYS = 16
UNKNOWN_COST = 2**30
"""Of a node that no way was found to yet; sums of it and any cost stay below 2^31."""
NODE_BITS = 24  # of a queue's key: the rest is the cost
NONE = -1

EAGERNESS = 4
"""What is left counts a sixteenth more (Pohl, Machine Intelligence 1970): a detour that the
least disc did not need is found without a look at all that costs as little."""

FIRST_SLOTS = 1024

Longs = NDArray[np.int64]
Integers = NDArray[np.int32]
Bools = NDArray[np.bool_]


class Ways(NamedTuple):
    """What steps and turns touch, in grid cells from a node, and what they cost."""

    steps: Longs  # (16, 2) in nodes
    lengths: Longs  # (16,)
    step_cells: Longs  # (16, k, 2) that the discs touch on a step
    step_counts: Longs  # (16,)
    turn_cells: Longs  # (16, m, 2) that they touch on a turn to the next way to the left
    turn_counts: Longs  # (16,)
    spin_cells: Longs  # (s, 2) that they touch on a whole turn
    turn_price: int
    reversal_price: int  # for going on tail first, or nose first again


class Plane(NamedTuple):
    """A plane of cells and the nodes over it."""

    field: NDArray[np.uint16]  # (nx, ny) squared cell distances
    threshold: int
    rates: Integers  # (t,) cost per length by squared distance
    factor: int
    shape: tuple[int, int]  # nodes


class Slots(NamedTuple):
    """What is known of the nodes that were seen, in the order in which they were."""

    cost: Integers  # (k, 16) to be in a state; only the first where the body can turn about
    via: Integers  # (k, 16) state before it, NONE of a start
    by: NDArray[np.uint8]  # (k, 16) way that it was reached by
    turns: Bools  # (k,) whether the body can turn about


@kernel
def cells_free(plane: Plane, i: int, j: int, cells: Longs, count: int) -> bool:
    """Whether all cells at these offsets from a grid cell are free."""
    nx, ny = plane.field.shape
    for n in range(count):
        x, y = i + cells[n, 0], j + cells[n, 1]
        if x < 0 or y < 0 or x >= nx or y >= ny or plane.field[x, y] <= plane.threshold:
            return False
    return True


@kernel
def rate_at(plane: Plane, i: int, j: int) -> int:
    """Cost per length at a grid cell."""
    return int(plane.rates[min(int(plane.field[i, j]), len(plane.rates) - 1)])


@kernel
def search_states(
    plane: Plane, ways: Ways, to_go: Integers, starts: Longs, prices: Longs, goal: int, budget: int
) -> tuple[Longs, Bools]:
    """States from a start to the goal's node, shape (n,), or none within the budget.

    Where the body can turn about it turns free of charge, so such a node is one state, not 16: the
    search goes straight down the costs-to-go there, and is wide only where the body is not free.

    Args:
        plane: Where.
        ways: How.
        to_go: At least about what it costs from each node to the goal, shape (nodes,).
        starts: States, shape (s,): a node times 16 and a way.
        prices: What it costs to be in them, shape (s,).
        goal: Node.
        budget: States that may be closed.

    Returns:
        The states, and at which of them the body can turn about, shape (n,): such a node has two,
        as the body comes and as it leaves.
    """
    rows, columns = plane.shape
    half = plane.factor // 2
    slots = np.full(rows * columns, NONE, np.int32)  # where what is known of a node stands
    count, seen = 0, new_slots(FIRST_SLOTS)
    queue = [np.int64(0)]  # of estimates of the whole with the states that they are of
    queue.pop()
    for n in range(len(starts)):
        node, way = starts[n] // WAYS, starts[n] % WAYS
        if slots[node] == NONE:
            seen = with_room(seen, count)
            i, j = node // columns, node % columns
            open_slot(plane, ways, i * plane.factor + half, j * plane.factor + half, seen, count)
            slots[node] = count
            count += 1
        slot = slots[node]
        state = 0 if seen.turns[slot] else way
        if prices[n] < seen.cost[slot, state]:
            seen.cost[slot, state], seen.by[slot, state] = prices[n], way
            key = key_of(prices[n], to_go[node], node * WAYS + state)
            heapq.heappush(queue, key)
    while len(queue) > 0 and budget > 0:
        key = heapq.heappop(queue)
        state = int(key & ((1 << NODE_BITS) - 1))
        node, way = state // WAYS, state % WAYS
        slot = slots[node]
        known, rest = int(seen.cost[slot, way]), int(to_go[node])
        if key >> NODE_BITS > known + rest + (rest >> EAGERNESS):
            continue
        if node == goal:
            return unwind(ways, slots, columns, seen, state)
        budget -= 1
        i, j = node // columns, node % columns
        u, v = i * plane.factor + half, j * plane.factor + half
        turns = seen.turns[slot]
        if not turns:
            for move in range(3):
                turned = (way + (WAYS // 2, 1, -1)[move]) % WAYS
                price = ways.reversal_price if move == 0 else ways.turn_price
                if known + price >= seen.cost[slot, turned]:
                    continue
                swept = turned if move == 2 else way
                if move > 0 and not cells_free(
                    plane, u, v, ways.turn_cells[swept], int(ways.turn_counts[swept])
                ):
                    continue
                seen.cost[slot, turned] = known + price
                seen.via[slot, turned], seen.by[slot, turned] = state, turned
                heapq.heappush(queue, key_of(known + price, rest, node * WAYS + turned))
        here = rate_at(plane, u, v)
        for ahead in range(0 if turns else way, WAYS if turns else way + 1):
            x, y = i + int(ways.steps[ahead, 0]), j + int(ways.steps[ahead, 1])
            if x < 0 or y < 0 or x >= rows or y >= columns:
                continue
            other, p, q = x * columns + y, x * plane.factor + half, y * plane.factor + half
            found = known + (int(ways.lengths[ahead]) * (here + rate_at(plane, p, q)) >> 1)
            at = slots[other]
            if at != NONE and found >= seen.cost[at, 0 if seen.turns[at] else ahead]:
                continue
            if not cells_free(plane, u, v, ways.step_cells[ahead], int(ways.step_counts[ahead])):
                continue
            if at == NONE:
                seen = with_room(seen, count)
                open_slot(plane, ways, p, q, seen, count)
                at, slots[other] = count, count
                count += 1
            to = 0 if seen.turns[at] else ahead
            seen.cost[at, to], seen.via[at, to], seen.by[at, to] = found, state, ahead
            heapq.heappush(queue, key_of(found, to_go[other], other * WAYS + to))
    return np.empty(0, np.int64), np.empty(0, np.bool_)


@kernel
def key_of(cost: int, rest: int, state: int) -> np.int64:
    """What a state is queued by: an estimate of the whole cost, and the state."""
    return np.int64((np.int64(cost + rest + (rest >> EAGERNESS)) << NODE_BITS) | state)


@kernel
def new_slots(count: int) -> Slots:
    """Room for what is known of so many nodes."""
    return Slots(
        np.full((count, WAYS), UNKNOWN_COST, np.int32),
        np.full((count, WAYS), NONE, np.int32),
        np.zeros((count, WAYS), np.uint8),
        np.zeros(count, np.bool_),
    )


@kernel
def with_room(seen: Slots, count: int) -> Slots:
    """The same, twice as large if there is no room for one more node."""
    if count < len(seen.turns):
        return seen
    larger = new_slots(2 * count)
    larger.cost[:count], larger.via[:count] = seen.cost, seen.via
    larger.by[:count], larger.turns[:count] = seen.by, seen.turns
    return larger


@kernel
def open_slot(plane: Plane, ways: Ways, u: int, v: int, seen: Slots, slot: int) -> None:
    """Look whether the body can turn about at a node in the middle of a grid cell."""
    seen.turns[slot] = cells_free(plane, u, v, ways.spin_cells, len(ways.spin_cells))


@kernel
def unwind(
    ways: Ways, slots: Integers, columns: int, seen: Slots, state: int
) -> tuple[Longs, Bools]:
    """The states that led to one, from the first, and at which of them the body can turn about.

    There are two of such a node, as it comes and as it leaves.
    """
    states, wide = [np.int64(state)], [False]
    states.pop()
    wide.pop()
    at, leaves = state, NONE
    while at != NONE:
        node = at // WAYS
        slot, way = slots[node], at % WAYS
        turns, arrives = bool(seen.turns[slot]), int(seen.by[slot, way])
        if turns and leaves != NONE:
            states.append(np.int64(node * WAYS + leaves))
            wide.append(turns)
        states.append(np.int64(node * WAYS + arrives))
        wide.append(turns)
        before = int(seen.via[slot, way])
        leaves = arrives if before == NONE or before // WAYS != node else NONE
        at = before
    return np.array(states)[::-1].copy(), np.array(wide)[::-1].copy()
