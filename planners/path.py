"""Paths as polylines, shape (n, 3), m: arc lengths, blended corners, headings and speed limits."""

from __future__ import annotations

import itertools
import math

import numpy as np

from wayproof.maps.elementary import cosine
from wayproof.planners.free_space import FreeSpace
from wayproof.planners.kernels import blend, curvature, polyline
from wayproof.planners.kernels.angles import edge_headings, yaw_of_direction
from wayproof.planners.kernels.grid import Floats, Pose
from wayproof.planners.kernels.headed import path_free

SPACING = 0.05
"""Largest distance between points of a blended path, m."""

LEAST_TURN = 0.05
"""Smallest turn by which a corner shares its edges, rad."""

SHARP_ANGLE = math.radians(50.0)
"""Turn from which on a corner is too sharp to take in motion, rad."""

SHARP_WINDOW = 0.3
"""Length of path within which that turn counts, m."""

HOOK_LENGTH = 0.2
"""Length below which an edge before or after a turn about is a hook, m."""

HOOK_COSINE = -0.5
"""Cosine of the turn beyond which a path turns about, 120 degrees."""


def edge_lengths(path: Floats) -> Floats:
    """Return the length of each edge, m, shape (n - 1,)."""
    lengths: Floats = polyline.edge_lengths(np.ascontiguousarray(path))
    return lengths


def arc_lengths(path: Floats) -> Floats:
    """Return the arc length at each point, m, shape (n,); the first is 0."""
    arcs: Floats = polyline.arc_lengths(np.ascontiguousarray(path))
    return arcs


def edge_tangents(path: Floats) -> Floats:
    """Return the unit direction (n - 1, 3) of each edge; without length, its neighbour's."""
    tangents: Floats = polyline.edge_tangents(np.ascontiguousarray(path))
    return tangents


def _dot(a: Floats, b: Floats) -> Floats:
    """Return the dot product over the last axis of 3, summed in a fixed order."""
    products: Floats = a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]
    return products


def point_at(path: Floats, s: float) -> Floats:
    """Return the point at an arc length, m, clamped to the path, shape (3,)."""
    point: Floats = polyline.point_at(np.ascontiguousarray(path, np.float64), float(s))
    return point


def tangent_at(path: Floats, s: float) -> Floats:
    """Return the unit tangent at an arc length, m, shape (3,); zero for a path without length."""
    tangent: Floats = polyline.tangent_at(np.ascontiguousarray(path, np.float64), float(s))
    return tangent


def truncate(path: Floats, s: float) -> Floats:
    """Return the path from its start to an arc length, m, shape (m, 3)."""
    kept: Floats = polyline.truncate(np.ascontiguousarray(path, np.float64), float(s))
    return kept


def remaining(path: Floats, s: float) -> Floats:
    """Return the path from an arc length, m, to its end, shape (m, 3)."""
    kept: Floats = polyline.remaining(np.ascontiguousarray(path, np.float64), float(s))
    return kept


def poses_along(points: Floats, start: Pose, goal: Pose | None) -> Floats:
    """Return poses of a body that heads along a path and turns at its corners, shape (n, 4).

    Args:
        points: Shape (n, 3), m.
        start: First pose.
        goal: Last pose; None to end at the heading of the last edge.
    """
    poses = [start]
    for a, b in itertools.pairwise(points):
        if b[0] == a[0] and b[1] == a[1]:
            heading = poses[-1][3]  # straight up or down
        else:
            heading = float(yaw_of_direction(b[0] - a[0], b[1] - a[1]))
        poses += [(*a, heading), (*b, heading)]
    return np.array(poses if goal is None else [*poses, goal], dtype=np.float64)


def without_hooks(space: FreeSpace, waypoints: Floats) -> Floats:
    """Return waypoints without those at which the path turns about after a short edge.

    A short step back while the body turns can cost less than a turn on the spot, but a robot in
    motion has to stop for it.

    Args:
        space: Free space.
        waypoints: Shape (n, 3), m, no two in a row the same.

    Returns:
        Shape (m, 3), m, with the ends of `waypoints`; free if they are, edge by edge.
    """
    n = 1
    while n < len(waypoints) - 1:
        edges = waypoints[n : n + 2] - waypoints[n - 1 : n + 1]
        before, after = edge_lengths(waypoints[n - 1 : n + 2]).tolist()
        turns_about = float(_dot(edges[0], edges[1])) < HOOK_COSINE * before * after
        shorter = np.delete(waypoints, n, axis=0)
        around = shorter[max(n - 2, 0) : n + 2]
        if (
            turns_about
            and min(before, after) < HOOK_LENGTH
            and path_free(space.grid, space.shape, bool(space.discs), around)
        ):
            waypoints, n = shorter, max(n - 1, 1)
        else:
            n += 1
    return waypoints


def blend_corners(
    space: FreeSpace, waypoints: Floats, blend_length: float, spacing: float = SPACING
) -> Floats:
    """Round each corner by a parabola and resample the path.

    The quadratic Bezier curve from `blend_length` before a corner to as much after it has, of the
    curves that stay within the corner's triangle, a low peak curvature: sin(a / 2) /
    (d cos(a / 2)^2) for a turn by a and a length d. A blend that would touch a forbidden cell is
    halved; if the smallest still does, the corner stays.

    Args:
        space: Free space.
        waypoints: Shape (n, 3), m.
        blend_length: Largest length cut from both edges of a corner, m; two corners share the edge
            between them by how far each of them turns.
        spacing: Largest distance between points of the result, m.

    Returns:
        Shape (m, 3), m, with the ends of `waypoints`; free if they are, edge by edge.
    """
    waypoints = np.ascontiguousarray(waypoints, dtype=np.float64)
    reaches = _reaches(waypoints, blend_length)
    tangents = np.empty((len(reaches), 2, 3))
    for n in range(len(reaches)):
        tangents[n] = edge_tangents(waypoints[n : n + 3])

    def blended(reaches: Floats) -> Floats:
        path: Floats = blend.blend_path(
            space.grid, space.shape, bool(space.discs), waypoints, tangents, reaches, spacing
        )
        return path

    # An edge cut short by its blends is rounded again and can touch a cell that it just missed.
    for share in (1.0, 0.7, 0.4):
        path = blended(share * reaches)
        if path_free(space.grid, space.shape, bool(space.discs), path):
            return path
    return blended(0.0 * reaches)


def _reaches(waypoints: Floats, blend_length: float) -> Floats:
    """Return the length (n - 2,), m, that each corner's blend may take of its edges."""
    lengths = edge_lengths(waypoints)
    turns = edge_lengths(edge_tangents(waypoints))  # (n - 2,) change of the tangent
    turns = np.concatenate(([0.0], np.maximum(turns, LEAST_TURN), [0.0]))  # none at the ends
    if len(waypoints) < 3:
        return np.empty(0)
    shares = turns[:-1] / np.maximum(turns[:-1] + turns[1:], LEAST_TURN)  # of the corner before
    before, after = lengths * (1.0 - shares), lengths * shares
    reaches: Floats = np.minimum(np.minimum(before[:-1], after[1:]), blend_length)
    return reaches


def speed_limits(path: Floats, lateral_acceleration: float, yaw_rate: float) -> Floats:
    """Return the largest speed (n,), m/s, that curvature allows; infinite at the ends.

    Args:
        path: Shape (n, 3), m.
        lateral_acceleration: Largest v^2 * curvature, m/s^2.
        yaw_rate: Largest v * change of heading per length, rad/s.
    """
    tangents = edge_tangents(path)
    headings = edge_headings(tangents, 0.0)
    limits: Floats = curvature.limit_speeds(
        edge_lengths(path), tangents, headings, lateral_acceleration, yaw_rate
    )
    return limits


def first_stop(
    path: Floats, s: float, angle: float = SHARP_ANGLE, window: float = SHARP_WINDOW
) -> float:
    """Return the arc length of the first corner after `s` that is too sharp to take in motion, m.

    A corner is too sharp if the path turns by more than `angle`, rad, within `window`, m; its place
    is the sharpest turn of that window.

    Returns:
        The place of the corner, or of the path's end if there is none.
    """
    arcs, tangents = arc_lengths(path), edge_tangents(path)
    first, least = int(polyline.edge_at(arcs, float(s))), cosine(angle)
    return float(curvature.first_sharp_corner(arcs, tangents, first, least, window))
