"""Kernels of the search over places and headings, for a body that cannot turn everywhere.

A node is the centre of every ``factor``-th grid cell along both axes; a state is a node and one of
16 ways: those to the neighbours and the knight's moves. The body lies along its way, nose or tail
ahead. What each disc's centre touches on a step or a turn are always the same cells relative to the
node, so a check is a walk through a table. Costs are integers.

A* (Hart, Nilsson, Raphael, IEEE TSSC 1968), drawn by the costs-to-go of the least disc, which the
search for its way found before.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.planners._jit import kernel

WAYS = 16
UNKNOWN_COST = 2**30
"""Of a node that no way was found to yet; sums of it and any cost stay below 2^31."""
NODE_BITS = 24  # of a queue's key: the rest is the cost
NONE = -1
ONE = np.uint64(1)

FIRST_ROOM = 4096
"""Keys that there is room for at first."""

EAGERNESS = 4
"""What is left counts a sixteenth more (Pohl, Machine Intelligence 1970): a detour that the
least disc did not need is found without a look at all that costs as little."""

Longs = NDArray[np.int64]
Integers = NDArray[np.int32]
Bools = NDArray[np.bool_]


class Swept(NamedTuple):
    """The cells that the centre of each disc touches on each of some motions, from a node."""

    cells: Longs  # (motions, discs, k, 2)
    counts: Longs  # (motions, discs) how many of the k
    middles: Longs  # (motions, discs, 2) the one of them that the others are nearest about
    reaches: Longs  # (motions, discs) within which they lie along each axis
    enough: Longs  # (motions, discs) all are free if the squared distance there is larger


class Ways(NamedTuple):
    """What steps and turns touch, and what they cost."""

    steps: Longs  # (16, 2) in nodes
    lengths: Longs  # (16,)
    stepped: Swept  # on a step
    turned: Swept  # on a turn to the next way to the left
    spun: Swept  # on a whole turn, the only motion
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
    """What is known of the nodes that were seen, in the order in which they were.

    There is room for all, but memory is lazy: what is not written costs nothing.
    """

    cost: Integers  # (k, 16) to be in a state; only the first where the body can turn about
    via: Integers  # (k, 16) state before it, NONE of a start
    by: NDArray[np.uint8]  # (k, 16) way that it was reached by
    turns: Bools  # (k,) whether the body can turn about


@kernel
def motion_free(plane: Plane, i: int, j: int, swept: Swept, motion: int) -> bool:
    """Whether all cells that the discs touch on a motion from a grid cell are free.

    From cell to cell a distance falls by no more than these are apart, so where it is large enough
    in the middle of a disc's cells none of them is looked at.
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
    """Cost per length at a grid cell."""
    return int(plane.rates[min(int(plane.field[i, j]), len(plane.rates) - 1)])


@kernel
def refine(nodes: Integers, factor: int, cells: Integers) -> None:
    """Fill cells with what lies between the nodes, each the middle of ``factor`` by ``factor``.

    Costs are for a cell's length then, and not for a node's. Beyond the outer nodes those count.
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
    # Arrays are taken out of the tuples here: taken out in the loop they are counted each time.
    steps, lengths, stepped, turned = ways.steps, ways.lengths, ways.stepped, ways.turned
    slots = np.full(rows * columns, NONE, np.int32)  # where what is known of a node stands
    seen = Slots(
        np.empty((rows * columns, WAYS), np.int32),
        np.empty((rows * columns, WAYS), np.int32),
        np.empty((rows * columns, WAYS), np.uint8),
        np.empty(rows * columns, np.bool_),
    )
    cost, via, by, turning = seen.cost, seen.via, seen.by, seen.turns
    count = 0
    queue, queued = np.empty(FIRST_ROOM, np.int64), 0
    for n in range(len(starts)):
        node, way = starts[n] // WAYS, starts[n] % WAYS
        if slots[node] == NONE:
            i, j = node // columns, node % columns
            open_slot(
                plane, ways.spun, i * plane.factor + half, j * plane.factor + half, seen, count
            )
            slots[node] = count
            count += 1
        slot = slots[node]
        state = 0 if turning[slot] else way
        if prices[n] < cost[slot, state]:
            cost[slot, state], via[slot, state], by[slot, state] = prices[n], NONE, way
            key = key_of(prices[n], to_go[node], node * WAYS + state)
            queue, queued = push(queue, queued, key), queued + 1
    while queued > 0 and budget > 0:
        queued -= 1
        key = pop(queue, queued)
        state = int(key & ((1 << NODE_BITS) - 1))
        node, way = state // WAYS, state % WAYS
        slot = slots[node]
        known, rest = int(cost[slot, way]), int(to_go[node])
        if key >> NODE_BITS > known + rest + (rest >> EAGERNESS):
            continue
        if node == goal:
            return unwind(slots, columns, seen, state)
        budget -= 1
        i, j = node // columns, node % columns
        u, v = i * plane.factor + half, j * plane.factor + half
        turns = turning[slot]
        if not turns:
            for move in range(3):
                other = (way + (WAYS // 2, 1, -1)[move]) % WAYS
                price = ways.reversal_price if move == 0 else ways.turn_price
                if known + price >= cost[slot, other]:
                    continue
                swept = other if move == 2 else way
                if move > 0 and not motion_free(plane, u, v, turned, swept):
                    continue
                cost[slot, other], via[slot, other], by[slot, other] = known + price, state, other
                key = key_of(known + price, rest, node * WAYS + other)
                queue, queued = push(queue, queued, key), queued + 1
        here = rate_at(plane, u, v)
        for ahead in range(0 if turns else way, WAYS if turns else way + 1):
            x, y = i + int(steps[ahead, 0]), j + int(steps[ahead, 1])
            if x < 0 or y < 0 or x >= rows or y >= columns:
                continue
            other, p, q = x * columns + y, x * plane.factor + half, y * plane.factor + half
            found = known + (int(lengths[ahead]) * (here + rate_at(plane, p, q)) >> 1)
            at = slots[other]
            if at != NONE and found >= cost[at, 0 if turning[at] else ahead]:
                continue
            if not motion_free(plane, u, v, stepped, ahead):
                continue
            if at == NONE:
                open_slot(plane, ways.spun, p, q, seen, count)
                at, slots[other] = count, count
                count += 1
            to = 0 if turning[at] else ahead
            cost[at, to], via[at, to], by[at, to] = found, state, ahead
            key = key_of(found, to_go[other], other * WAYS + to)
            queue, queued = push(queue, queued, key), queued + 1
    return np.empty(0, np.int64), np.empty(0, np.bool_)


@kernel
def key_of(cost: int, rest: int, state: int) -> int:
    """What a state is queued by: an estimate of the whole cost, and the state."""
    return int(cost + rest + (rest >> EAGERNESS)) << NODE_BITS | int(state)


@kernel
def push(queue: Longs, count: int, key: int) -> Longs:
    """Put a key into a binary heap of so many; return the heap, which has grown if it was full.

    Written out, as Python's on a list takes twice the time here.
    """
    if count == len(queue):
        queue = np.concatenate((queue, np.empty(count, np.int64)))
    at = np.uint64(count)  # of a signed index it is asked each time whether it is below 0
    while at > 0:
        above = (at - ONE) >> ONE
        if queue[above] <= key:
            break
        queue[at] = queue[above]
        at = above
    queue[at] = key
    return queue


@kernel
def pop(queue: Longs, count: int) -> int:
    """Take the least key out of a heap, which has so many then."""
    least, end = queue[0], np.uint64(count)
    last, at, below = queue[end], np.uint64(0), ONE
    while below + ONE < end:
        # Without a branch: which of the two is less cannot be foreseen.
        below += np.uint64(queue[below + ONE] < queue[below])
        if queue[below] >= last:
            break
        queue[at] = queue[below]
        at, below = below, (below << ONE) + ONE
    if below + ONE == end and queue[below] < last:  # it has no other beside it
        queue[at] = queue[below]
        at = below
    queue[at] = last
    return int(least)


@kernel
def open_slot(plane: Plane, spun: Swept, u: int, v: int, seen: Slots, slot: int) -> None:
    """Know nothing of a node in the middle of a grid cell but whether the body can turn about."""
    seen.cost[slot] = UNKNOWN_COST
    seen.turns[slot] = motion_free(plane, u, v, spun, 0)


@kernel
def unwind(slots: Integers, columns: int, seen: Slots, state: int) -> tuple[Longs, Bools]:
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
