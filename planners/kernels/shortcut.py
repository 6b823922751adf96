"""Shortcuts of a path of positions: random cuts and detours, and waypoints left out."""

from __future__ import annotations

import math

import numpy as np

from wayproof.kernel_compiler import allocating, kernel
from wayproof.planners.kernels.grid import Floats, Grid, Point
from wayproof.planners.kernels.polyline import between, distance, locate, row
from wayproof.planners.kernels.segment import edge_cost

LEAST_GAIN = 1e-9
"""Least saving for which a path is changed, m: above the rounding error of its cost."""


@allocating
def shortcut(
    grid: Grid, threshold: int, weight: float, corner_cost: float, path: Floats, draws: Floats
) -> Floats:
    """Lower a path's cost by replacing the part between two random points of it.

    Random shortcuts after Geraerts and Overmars, "Creating High-quality Paths for Motion
    Planning", IJRR 2007, accepted by cost instead of length. Where the straight cut does not pay, a
    detour over the cut's middle, moved by a random offset, is tried, so that a path can draw away
    from obstacles, too. A replacement is free and costs less.

    Args:
        grid: The distance field.
        threshold: A cell is forbidden at or below this squared distance.
        weight: Weight of the cell cost against length.
        corner_cost: Cost of each corner, m.
        path: Waypoints, m, shape (n, 3), n >= 2, free edge by edge.
        draws: Shape (m, 5): two places along the path in [0, 1) and the offset, m.

    Returns:
        Waypoints between the same ends, shape (k, 3).
    """
    room = len(path) + 3 * len(draws)
    points, arcs, costs = np.empty((room, 3)), np.empty(room), np.empty(room)
    points[: len(path)] = path
    count = len(path)
    for n in range(count - 1):
        costs[n] = edge_cost(grid, threshold, weight, row(points, n), row(points, n + 1))
    changed = True
    for draw in draws:
        if changed:
            arcs[0] = 0.0
            for n in range(count - 1):
                arcs[n + 1] = arcs[n] + distance(row(points, n), row(points, n + 1))
        length = arcs[count - 1]
        i, u = locate(points, arcs, count, min(draw[0], draw[1]) * length)
        j, v = locate(points, arcs, count, max(draw[0], draw[1]) * length)
        middle = between(u, v, 0.5)
        apex = (middle[0] + draw[2], middle[1] + draw[3], middle[2] + draw[4])
        ends = (row(points, i), u, v, row(points, j + 1))
        old = total(costs[i : j + 1]) + corner_cost * (j - i)
        added, a, b, c, d = detour(grid, threshold, weight, ends, apex, old, corner_cost)
        changed = added > 0
        if changed:
            # Points i + 1 to j make room for u, the apex if there is one, and v.
            shift = i + 1 + added - (j + 1)
            last = count + shift
            points[j + 1 + shift : last] = points[j + 1 : count].copy()
            costs[j + 1 + shift : last - 1] = costs[j + 1 : count - 1].copy()
            points[i + 1] = u
            if added == 3:
                points[i + 2] = apex
            points[i + added] = v
            fresh = (a, b, c, d)
            for n in range(added + 1):
                costs[i + n] = fresh[n]
            count = last
    return fewest_corners(grid, threshold, weight, corner_cost, points[:count])


@kernel
def total(values: Floats) -> float:
    """Sum in order; numpy's sum is slow to compile, and to load once compiled."""
    found = 0.0
    for value in values:
        found += value
    return found


@kernel
def detour(
    grid: Grid,
    threshold: int,
    weight: float,
    ends: tuple[Point, Point, Point, Point],
    apex: Point,
    old: float,
    corner_cost: float,
) -> tuple[int, float, float, float, float]:
    """Try to replace the way from `ends[1]` to `ends[2]` by a straight edge, else by an apex.

    Args:
        grid: The distance field.
        threshold: A cell is forbidden at or below this squared distance.
        weight: Weight of the cell cost against length.
        ends: The point before the cut, its two ends, and the point after it, m.
        apex: Middle point of the detour, m.
        old: Cost of the present way from the first to the last of the ends, with corners, m.
        corner_cost: Cost of a corner, m.

    Returns:
        How many points the cheaper way has between the first and the last (0 if none is cheaper,
        2 or 3), and the costs of its edges, m.
    """
    outside, u, v, beyond = ends
    # No edge costs less than its length, so most attempts end before a cell is looked at.
    least = distance(outside, u) + distance(v, beyond) + LEAST_GAIN + 2.0 * corner_cost
    if least + distance(u, v) >= old:
        return 0, 0.0, 0.0, 0.0, 0.0
    straight = edge_cost(grid, threshold, weight, u, v)
    first, last = math.inf, math.inf
    if least + straight < old:
        first = edge_cost(grid, threshold, weight, outside, u)
        last = edge_cost(grid, threshold, weight, v, beyond)
        if first + straight + last + 2.0 * corner_cost < old - LEAST_GAIN:
            return 2, first, straight, last, 0.0
    least += corner_cost
    if least + distance(u, apex) + distance(apex, v) >= old:
        return 0, 0.0, 0.0, 0.0, 0.0
    to_apex = edge_cost(grid, threshold, weight, u, apex)
    if least + to_apex + distance(apex, v) >= old:
        return 0, 0.0, 0.0, 0.0, 0.0
    from_apex = edge_cost(grid, threshold, weight, apex, v)
    if least + to_apex + from_apex >= old:
        return 0, 0.0, 0.0, 0.0, 0.0
    if first == math.inf:
        first = edge_cost(grid, threshold, weight, outside, u)
        last = edge_cost(grid, threshold, weight, v, beyond)
    if first + to_apex + from_apex + last + 3.0 * corner_cost < old - LEAST_GAIN:
        return 3, first, to_apex, from_apex, last
    return 0, 0.0, 0.0, 0.0, 0.0


@allocating
def prune(grid: Grid, threshold: int, weight: float, path: Floats) -> Floats:
    """Leave out each waypoint without which the path costs no more."""
    kept = path.copy()
    count = 1
    for n in range(1, len(path) - 1):
        before, here, after = row(kept, count - 1), row(path, n), row(path, n + 1)
        through = edge_cost(grid, threshold, weight, before, here)
        through += edge_cost(grid, threshold, weight, here, after)
        if edge_cost(grid, threshold, weight, before, after) > through + LEAST_GAIN:
            kept[count] = path[n]
            count += 1
    kept[count] = path[-1]
    return kept[: count + 1].copy()


@allocating
def fewest_corners(
    grid: Grid, threshold: int, weight: float, corner_cost: float, path: Floats
) -> Floats:
    """Return the cheapest path through some of a path's waypoints, in order, shape (k, 3).

    The optimum by dynamic programming over the edges between any two of them, with corner costs.
    """
    count = len(path)
    least, before = np.full(count, np.inf), np.zeros(count, np.int64)
    least[0] = 0.0
    for n in range(1, count):
        here = row(path, n)
        for m in range(n - 1, -1, -1):
            known = least[m] + corner_cost
            if known + distance(row(path, m), here) + LEAST_GAIN >= least[n]:
                continue
            cost = known + edge_cost(grid, threshold, weight, row(path, m), here)
            if cost + LEAST_GAIN < least[n]:
                least[n], before[n] = cost, m
    kept = np.empty((count, 3))
    end, first = count - 1, count
    while True:
        first -= 1
        kept[first] = path[end]
        if end == 0:
            return kept[first:].copy()
        end = before[end]
