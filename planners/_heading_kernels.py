"""Kernels of the search over places and headings, for a body that cannot turn everywhere.

A node is the centre of every ``factor``-th grid cell along both axes; a state is a node and one of
16 ways: those to the neighbours and the knight's moves. The body lies along its way, nose or tail
ahead. What each disc's centre touches on a step or a turn are always the same cells relative to the
node, so a check is a walk through a table. Costs are integers.

A* (Hart, Nilsson, Raphael, IEEE TSSC 1968), drawn by the exact cost-to-go of the least disc.
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

Longs = NDArray[np.int64]
Integers = NDArray[np.int32]


class Ways(NamedTuple):
    """What steps and turns touch, in grid cells from a node, and what they cost."""

    steps: Longs  # (16, 2) in nodes
    lengths: Longs  # (16,)
    step_cells: Longs  # (16, k, 2) that the discs touch on a step
    step_counts: Longs  # (16,)
    turn_cells: Longs  # (16, m, 2) that they touch on a turn to the next way to the left
    turn_counts: Longs  # (16,)
    turn_price: int
    reversal_price: int  # for going on tail first, or nose first again


class Plane(NamedTuple):
    """A plane of cells and the nodes over it."""

    field: NDArray[np.uint16]  # (nx, ny) squared cell distances
    threshold: int
    rates: Integers  # (t,) cost per length by squared distance
    factor: int
    shape: tuple[int, int]  # nodes


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
def costs_to_go(plane: Plane, ways: Ways, goal: int, targets: Longs) -> Integers:
    """Cost of the least disc from each node to the goal, shape (n,), at least until all targets.

    Nodes farther than half as much again are told the cost at which the search ended. The queue is
    one of buckets (Dial, CACM 1969): no step costs as much as there are of them.
    """
    rows, columns = plane.shape
    rates = node_rates(plane)
    cost = np.full(rows * columns, UNKNOWN_COST, np.int32)
    after, before = np.empty(rows * columns, np.int32), np.empty(rows * columns, np.int32)
    head = np.full(int(ways.lengths.max()) * int(plane.rates.max()) + 1, NONE, np.int32)
    wanted = np.zeros(rows * columns, np.bool_)
    for target in targets:
        wanted[target] = True
    left, most, last = len(targets), UNKNOWN_COST, 0
    cost[goal] = 0
    insert(head, after, before, goal, 0)
    opened, reached = 1, 0
    while opened > 0:
        node = int(head[reached % len(head)])
        if node == NONE:
            reached += 1
            continue
        remove(head, after, before, node, reached)
        opened -= 1
        last = reached
        if reached > most:
            break
        if wanted[node]:
            left -= 1
            wanted[node] = False
            if left == 0:
                most = reached + (reached >> 1)
        i, j = node // columns, node % columns
        for way in range(WAYS):
            x, y = i + int(ways.steps[way, 0]), j + int(ways.steps[way, 1])
            if x < 0 or y < 0 or x >= rows or y >= columns or rates[x, y] < 0:
                continue
            found = reached + (int(ways.lengths[way]) * int(rates[i, j] + rates[x, y]) >> 1)
            to = x * columns + y
            if found < cost[to]:
                if cost[to] < UNKNOWN_COST:
                    remove(head, after, before, to, int(cost[to]))
                    opened -= 1
                cost[to] = found
                insert(head, after, before, to, found)
                opened += 1
    if last > most:
        for node in range(len(cost)):
            cost[node] = min(cost[node], last)
    return cost


@kernel
def node_rates(plane: Plane) -> Integers:
    """Cost per length at each node, shape (rows, columns); -1 where the least disc is not free."""
    rows, columns = plane.shape
    half = plane.factor // 2
    rates = np.empty((rows, columns), np.int32)
    for i in range(rows):
        for j in range(columns):
            u, v = i * plane.factor + half, j * plane.factor + half
            free = plane.field[u, v] > plane.threshold
            rates[i, j] = rate_at(plane, u, v) if free else NONE
    return rates


@kernel
def insert(head: Integers, after: Integers, before: Integers, node: int, key: int) -> None:
    """Put a node first into the bucket of its key."""
    bucket = key % len(head)
    first = head[bucket]
    after[node], before[node] = first, NONE
    if first >= 0:
        before[first] = node
    head[bucket] = node


@kernel
def remove(head: Integers, after: Integers, before: Integers, node: int, key: int) -> None:
    """Take a node out of the bucket of its key."""
    if before[node] >= 0:
        after[before[node]] = after[node]
    else:
        head[key % len(head)] = after[node]
    if after[node] >= 0:
        before[after[node]] = before[node]


@kernel
def search_states(
    plane: Plane, ways: Ways, to_go: Integers, starts: Longs, prices: Longs, goal: int, budget: int
) -> Longs:
    """States from a start to the goal's node, shape (n,), or none within the budget.

    Args:
        plane: Where.
        ways: How.
        to_go: From ``costs_to_go``.
        starts: States, shape (s,): a node times 16 and a way.
        prices: What it costs to be in them, shape (s,).
        goal: Node.
        budget: States that may be closed.
    """
    rows, columns = plane.shape
    cost = np.full(rows * columns * WAYS, UNKNOWN_COST, np.int32)
    via = np.full(rows * columns * WAYS, NONE, np.int32)
    queue = [np.int64(-1)]
    queue.pop()
    for n in range(len(starts)):
        if prices[n] < cost[starts[n]] and to_go[starts[n] // WAYS] < UNKNOWN_COST:
            cost[starts[n]] = prices[n]
            key = (int(prices[n] + to_go[starts[n] // WAYS]) << NODE_BITS) | int(starts[n])
            heapq.heappush(queue, np.int64(key))
    half = plane.factor // 2
    while len(queue) > 0 and budget > 0:
        key = int(heapq.heappop(queue))
        state = key & ((1 << NODE_BITS) - 1)
        node, way = state // WAYS, state % WAYS
        known = int(cost[state])
        if key >> NODE_BITS > known + to_go[node]:
            continue
        if node == goal:
            return unwind(via, state)
        budget -= 1
        i, j = node // columns, node % columns
        u, v = i * plane.factor + half, j * plane.factor + half
        for move in range(4):
            to, found = state, known
            if move == 0:
                x, y = i + int(ways.steps[way, 0]), j + int(ways.steps[way, 1])
                if x < 0 or y < 0 or x >= rows or y >= columns:
                    continue
                if not cells_free(plane, u, v, ways.step_cells[way], int(ways.step_counts[way])):
                    continue
                there = rate_at(plane, x * plane.factor + half, y * plane.factor + half)
                to = (x * columns + y) * WAYS + way
                found += int(ways.lengths[way]) * (rate_at(plane, u, v) + there) >> 1
            elif move == 1:
                to = node * WAYS + (way + WAYS // 2) % WAYS
                found += ways.reversal_price
            else:
                turned = (way + 1) % WAYS if move == 2 else (way - 1) % WAYS
                swept = way if move == 2 else turned
                to = node * WAYS + turned
                found += ways.turn_price
                if found >= cost[to]:
                    continue
                count = int(ways.turn_counts[swept])
                if not cells_free(plane, u, v, ways.turn_cells[swept], count):
                    continue
            if found < cost[to] and to_go[to // WAYS] < UNKNOWN_COST:
                cost[to], via[to] = found, state
                key = ((found + int(to_go[to // WAYS])) << NODE_BITS) | to
                heapq.heappush(queue, np.int64(key))
    return np.empty(0, np.int64)


@kernel
def unwind(via: Integers, state: int) -> Longs:
    """The states that led to one, from the first."""
    count, at = 1, state
    while via[at] != NONE:
        at = via[at]
        count += 1
    states = np.empty(count, np.int64)
    at = state
    for n in range(count - 1, -1, -1):
        states[n] = at
        at = via[at]
    return states
