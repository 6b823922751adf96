"""Geometry of polylines, shape (n, 3), m: lengths, tangents and points along them."""

from __future__ import annotations

import math

import numpy as np

from wayproof.kernel_compiler import allocating, kernel
from wayproof.planners.kernels.grid import Floats, Point

LEAST_EDGE = 1e-6
"""Shortest edge with a direction, m: a shorter one is left over by rounding."""


@kernel
def distance(a: Point, b: Point) -> float:
    """Return the Euclidean distance, summed in a fixed order."""
    x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    return math.sqrt(x * x + y * y + z * z)


@kernel
def row(points: Floats, n: int) -> Point:
    """Return one point of an array (n, 3), as a tuple."""
    return points[n, 0], points[n, 1], points[n, 2]


@kernel
def between(a: Point, b: Point, share: float) -> Point:
    """Return the point at a share of the edge from `a` to `b`."""
    return (
        a[0] + share * (b[0] - a[0]),
        a[1] + share * (b[1] - a[1]),
        a[2] + share * (b[2] - a[2]),
    )


@allocating
def edge_lengths(path: Floats) -> Floats:
    """Return the length of each edge, m, shape (n - 1,)."""
    lengths = np.empty(max(len(path) - 1, 0))
    for n in range(len(lengths)):
        lengths[n] = distance(row(path, n), row(path, n + 1))
    return lengths


@allocating
def arc_lengths(path: Floats) -> Floats:
    """Return the arc length at each point, m, shape (n,); the first is 0."""
    arcs = np.zeros(len(path))
    for n in range(1, len(path)):
        arcs[n] = arcs[n - 1] + distance(row(path, n - 1), row(path, n))
    return arcs


@kernel
def path_length(path: Floats) -> float:
    """Return the length of a polyline, m."""
    length = 0.0
    for n in range(len(path) - 1):
        length += distance(row(path, n), row(path, n + 1))
    return length


@allocating
def edge_tangents(path: Floats) -> Floats:
    """Return the unit direction (n - 1, 3) of each edge; without length, its neighbour's.

    The next neighbour's, or at the end of the path the one before. Zero for a path without length.
    """
    lengths = edge_lengths(path)
    tangents = np.zeros((len(lengths), 3))
    last = len(lengths)  # the last edge that has a length
    for n in range(len(lengths) - 1, -1, -1):
        if lengths[n] > LEAST_EDGE:
            for i in range(3):
                tangents[n, i] = (path[n + 1, i] - path[n, i]) / lengths[n]
            if last == len(lengths):
                last = n
                tangents[n + 1 :] = tangents[n]
        elif last < len(lengths):
            tangents[n] = tangents[n + 1]
    return tangents


@kernel
def edge_at(arcs: Floats, s: float) -> int:
    """Return the index of the edge that holds an arc length; at a point, of the next edge."""
    edge = 0
    while edge + 2 < len(arcs) and arcs[edge + 1] <= s:
        edge += 1
    return edge


@allocating
def point_at(path: Floats, s: float) -> Floats:
    """Return the point at an arc length, m, clamped to the path, shape (3,)."""
    arcs, s = arc_lengths(path), max(s, 0.0)
    point: Floats = path[-1].copy()
    if s < arcs[-1]:
        edge = edge_at(arcs, s)
        share = (s - arcs[edge]) / (arcs[edge + 1] - arcs[edge])
        for i in range(3):
            point[i] = path[edge, i] + share * (path[edge + 1, i] - path[edge, i])
    return point


@allocating
def tangent_at(path: Floats, s: float) -> Floats:
    """Return the unit tangent at an arc length, m, shape (3,); zero for a path without length."""
    tangent = np.zeros(3)
    if len(path) > 1:
        tangent[:] = edge_tangents(path)[edge_at(arc_lengths(path), s)]
    return tangent


@allocating
def truncate(path: Floats, s: float) -> Floats:
    """Return the path from its start to an arc length, m, shape (m, 3)."""
    arcs = arc_lengths(path)
    count = 1
    while count < len(path) and arcs[count] < s - LEAST_EDGE:
        count += 1
    kept = np.empty((count + 1, 3))
    kept[:count], kept[count] = path[:count], point_at(path, s)
    return kept


@allocating
def remaining(path: Floats, s: float) -> Floats:
    """Return the path from an arc length, m, to its end, shape (m, 3)."""
    arcs = arc_lengths(path)
    first = len(path) - 1
    while first > 0 and arcs[first - 1] > s + LEAST_EDGE:
        first -= 1
    kept = np.empty((1 + len(path) - first, 3))
    kept[0], kept[1:] = point_at(path, s), path[first:]
    return kept


@kernel
def locate(points: Floats, arcs: Floats, count: int, arc: float) -> tuple[int, Point]:
    """Return the edge and point at an arc length, m, along the first `count` points."""
    for n in range(count - 1):
        if arc <= arcs[n + 1] and arcs[n + 1] > arcs[n]:
            share = (arc - arcs[n]) / (arcs[n + 1] - arcs[n])
            return n, between(row(points, n), row(points, n + 1), share)
    return count - 2, row(points, count - 1)
