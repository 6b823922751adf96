"""Corners of a path rounded by parabolas, as large as free space allows."""

from __future__ import annotations

import math

import numpy as np

from wayproof.kernel_compiler import allocating
from wayproof.planners.kernels.grid import Discs, Floats, Grid, Point
from wayproof.planners.kernels.headed import path_free
from wayproof.planners.kernels.polyline import LEAST_EDGE, distance, row

BLEND_HALVINGS = 5
"""Number of sizes of a blend that are tried, each half of the one before."""

LEAST_BLEND_EDGES = 8
"""Least number of edges of a blend, from whose points its curvature is read."""

COSINE_BACK = -0.7
"""Cosine of the sharpest turn that a long body blends, 135 degrees: beyond it, it reverses."""


@allocating
def blend_path(
    grid: Grid,
    discs: Discs,
    oriented: bool,
    waypoints: Floats,
    tangents: Floats,
    reaches: Floats,
    spacing: float,
) -> Floats:
    """Join waypoints by straight edges and each corner's largest free blend, shape (m, 3).

    Args:
        grid: The distance field.
        discs: Discs of the body.
        oriented: Whether it heads along the path.
        waypoints: Shape (n, 3), m.
        tangents: Unit directions before and after each corner, shape (n - 2, 2, 3).
        reaches: Length that each blend may take of both edges, m, shape (n - 2,).
        spacing: Largest distance between points, m.
    """
    pieces = [waypoints[:1].copy()]
    last = row(waypoints, 0)
    for n in range(1, len(waypoints)):
        piece = waypoints[n : n + 1].copy()
        if n < len(waypoints) - 1:
            piece = blend_corner(
                grid, discs, oriented, piece, tangents[n - 1], float(reaches[n - 1]), spacing
            )
        first = row(piece, 0)
        if distance(last, first) < LEAST_EDGE:
            pieces[-1] = pieces[-1][:-1].copy()  # one blend begins where the other ends
            pieces.append(piece)
        else:
            pieces.append(straight_edge(grid, discs, oriented, last, first, spacing))
            pieces.append(piece[1:].copy())
        last = row(piece, len(piece) - 1)
    # np.concatenate takes no list of arrays in a kernel.
    count = 0
    for piece in pieces:
        count += len(piece)
    path = np.empty((count, 3))
    for piece in pieces[::-1]:
        path[count - len(piece) : count] = piece
        count -= len(piece)
    return path


@allocating
def blend_corner(
    grid: Grid,
    discs: Discs,
    oriented: bool,
    corner: Floats,
    tangents: Floats,
    length: float,
    spacing: float,
) -> Floats:
    """Return the points (k, 3) of a corner's largest free blend; without one the corner (1, 3)."""
    before, at, after = row(tangents, 0), row(corner, 0), row(tangents, 1)
    cosine = before[0] * after[0] + before[1] * after[1] + before[2] * after[2]
    if length < LEAST_EDGE or (oriented and cosine < COSINE_BACK):  # it stops there
        return corner
    for _ in range(BLEND_HALVINGS):
        edges = max(math.ceil(2.0 * length / spacing), LEAST_BLEND_EDGES)
        # The quadratic Bezier curve from `length` before the corner to `length` after it.
        points = np.empty((edges + 1, 3))
        for n in range(edges + 1):
            t = n * (1.0 / edges) if n < edges else 1.0
            for i in range(3):
                start, end = at[i] - length * before[i], at[i] + length * after[i]
                points[n, i] = (1.0 - t) * (1.0 - t) * start + 2.0 * t * (1.0 - t) * at[i]
                points[n, i] += t * t * end
        if path_free(grid, discs, oriented, points):
            return points
        length *= 0.5
    return corner


@allocating
def straight_edge(
    grid: Grid, discs: Discs, oriented: bool, a: Point, b: Point, spacing: float
) -> Floats:
    """Return points after `a` up to `b`, at most `spacing`, m, apart, shape (k, 3)."""
    edges = max(math.ceil(distance(a, b) / spacing), 1)
    points = np.empty((edges + 1, 3))
    for n in range(edges + 1):
        t = n * (1.0 / edges)
        for i in range(3):
            points[n, i] = a[i] + t * (b[i] - a[i])
    points[0], points[edges] = a, b
    # Rounded points can touch a cell that the edge itself just misses: then only `b` is taken.
    if path_free(grid, discs, oriented, points):
        return points[1:].copy()
    return points[edges:].copy()
