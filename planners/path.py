"""Geometry of polyline paths, shape (n, 3) [m]: corners blended, arc length, speed limits."""

import math

import numpy as np

from wayproof.maps.elementary import cosine
from wayproof.planners import kernels
from wayproof.planners._jit import kernel
from wayproof.planners.free_space import FreeSpace
from wayproof.planners.kernels import LEAST_EDGE, Floats, edge_headings

SPACING = 0.05  # of a resampled path [m]
# A corner that turns by less shares its edges as if it turned by this [rad].
LEAST_TURN = 0.05
SHARP_ANGLE = math.radians(50.0)
SHARP_WINDOW = 0.3  # [m]


def edge_lengths(path: Floats) -> Floats:
    """Length of each edge [m], shape (n - 1,)."""
    lengths: Floats = _edge_lengths(np.ascontiguousarray(path))
    return lengths


def arc_lengths(path: Floats) -> Floats:
    """Arc length at each point [m], shape (n,); the first is 0."""
    arcs: Floats = _arc_lengths(np.ascontiguousarray(path))
    return arcs


def edge_tangents(path: Floats) -> Floats:
    """Unit direction of each edge, shape (n - 1, 3); an edge of no length takes its neighbour's."""
    tangents: Floats = _edge_tangents(np.ascontiguousarray(path))
    return tangents


@kernel
def _edge_lengths(path: Floats) -> Floats:
    lengths = np.empty(max(len(path) - 1, 0))
    for k in range(len(lengths)):
        x = path[k + 1, 0] - path[k, 0]
        y = path[k + 1, 1] - path[k, 1]
        z = path[k + 1, 2] - path[k, 2]
        lengths[k] = math.sqrt(x * x + y * y + z * z)
    return lengths


@kernel
def _arc_lengths(path: Floats) -> Floats:
    arcs = np.zeros(len(path))
    for k in range(1, len(path)):
        x = path[k, 0] - path[k - 1, 0]
        y = path[k, 1] - path[k - 1, 1]
        z = path[k, 2] - path[k - 1, 2]
        arcs[k] = arcs[k - 1] + math.sqrt(x * x + y * y + z * z)
    return arcs


@kernel
def _edge_tangents(path: Floats) -> Floats:
    """From the end on, so that an edge of no length finds its next neighbour's tangent there."""
    lengths = _edge_lengths(path)
    tangents = np.zeros((len(lengths), 3))
    last = len(lengths)  # the last edge with a length: its tangent is that of all behind it
    for k in range(len(lengths) - 1, -1, -1):
        if lengths[k] > LEAST_EDGE:
            for i in range(3):
                tangents[k, i] = (path[k + 1, i] - path[k, i]) / lengths[k]
            if last == len(lengths):
                last = k
                tangents[k + 1 :] = tangents[k]
        elif last < len(lengths):
            tangents[k] = tangents[k + 1]
    return tangents


def _dot(a: Floats, b: Floats) -> Floats:
    """Dot product over the last axis of 3, summed in a fixed order."""
    products: Floats = a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]
    return products


def _edge_at(arcs: Floats, s: float) -> int:
    """Index of the edge that holds an arc length; at a point, of the edge that begins there."""
    return min(max(int(np.searchsorted(arcs, s, side="right")) - 1, 0), max(len(arcs) - 2, 0))


def point_at(path: Floats, s: float) -> Floats:
    """Point at an arc length [m], clamped to the path, shape (3,)."""
    arcs = arc_lengths(path)
    if s >= arcs[-1]:
        end: Floats = path[-1].copy()
        return end
    edge = _edge_at(arcs, s)
    share = (max(s, 0.0) - arcs[edge]) / (arcs[edge + 1] - arcs[edge])
    point: Floats = path[edge] + share * (path[edge + 1] - path[edge])
    return point


def tangent_at(path: Floats, s: float) -> Floats:
    """Unit tangent at an arc length [m], shape (3,); zero for a path of no length."""
    if len(path) == 1:
        return np.zeros(3)
    tangent: Floats = edge_tangents(path)[_edge_at(arc_lengths(path), s)]
    return tangent


def truncate(path: Floats, s: float) -> Floats:
    """The path from its start to an arc length [m], shape (m, 3)."""
    before = arc_lengths(path) < s - LEAST_EDGE
    before[0] = True
    return np.vstack((path[before], point_at(path, s)))


def remaining(path: Floats, s: float) -> Floats:
    """The path from an arc length [m] to its end, shape (m, 3)."""
    beyond = arc_lengths(path) > s + LEAST_EDGE
    beyond[-1] = True
    return np.vstack((point_at(path, s), path[beyond]))


def project(path: Floats, point: Floats) -> float:
    """Arc length [m] of the path's point nearest to a point; the first of several."""
    if len(path) == 1:
        return 0.0
    lengths, tangents = edge_lengths(path), edge_tangents(path)
    along = np.clip(_dot(point - path[:-1], tangents), 0.0, lengths)  # (n - 1,)
    offsets = point - path[:-1] - along[:, None] * tangents  # (n - 1, 3)
    edge = int(np.argmin(_dot(offsets, offsets)))
    return float(arc_lengths(path)[edge] + along[edge])


def blend_corners(
    space: FreeSpace, waypoints: Floats, blend_length: float, spacing: float = SPACING
) -> Floats:
    """Round each corner by a parabola and resample the path.

    The quadratic Bezier curve from ``blend_length`` before a corner to as much after it has, of
    the curves that stay within the corner's triangle, a low peak curvature: sin(a / 2) /
    (d cos(a / 2)^2) for a turn by a and a length d. A blend that would touch a forbidden cell is
    halved; if it still does at the last, the corner stays.

    Args:
        space: Where blends may run.
        waypoints: Shape (n, 3) [m].
        blend_length: Length cut from both edges of a corner, at most [m]; two corners share the
            edge between them by how far each of them turns.
        spacing: Largest distance between points of the result [m].

    Returns:
        Shape (m, 3) [m], with the ends of ``waypoints``; free if they are, edge by edge.
    """
    waypoints = np.ascontiguousarray(waypoints, dtype=np.float64)
    reaches = _reaches(waypoints, blend_length)
    tangents = np.empty((len(reaches), 2, 3))
    for n in range(len(reaches)):
        tangents[n] = edge_tangents(waypoints[n : n + 3])
    body = space.grid, space.shape, bool(space.discs)
    # An edge cut short by its blends is rounded anew and can touch a cell that it just missed.
    for share in (1.0, 0.7, 0.4):
        path: Floats = kernels.blended(*body, waypoints, tangents, share * reaches, spacing)
        if kernels.all_free(*body, path):
            return path
    bare: Floats = kernels.blended(*body, waypoints, tangents, 0.0 * reaches, spacing)
    return bare


def _reaches(waypoints: Floats, blend_length: float) -> Floats:
    """Length that each corner's blend may take of its edges [m], shape (n - 2,)."""
    lengths = edge_lengths(waypoints)
    turns = edge_lengths(edge_tangents(waypoints))  # (n - 2,) change of the tangent
    turns = np.concatenate(([0.0], np.maximum(turns, LEAST_TURN), [0.0]))  # the ends turn nowhere
    if len(waypoints) < 3:
        return np.empty(0)
    shares = turns[:-1] / np.maximum(turns[:-1] + turns[1:], LEAST_TURN)  # of the corner before
    before, after = lengths * (1.0 - shares), lengths * shares
    reaches: Floats = np.minimum(np.minimum(before[:-1], after[1:]), blend_length)
    return reaches


def speed_limits(path: Floats, lateral_acceleration: float, yaw_rate: float) -> Floats:
    """Largest speed at each point [m/s], shape (n,), that curvature allows; infinite at the ends.

    Args:
        path: Shape (n, 3) [m].
        lateral_acceleration: v^2 * curvature stays below it [m/s^2].
        yaw_rate: v * change of heading per length stays below it [rad/s].
    """
    tangents = edge_tangents(path)
    headings = edge_headings(tangents, 0.0)
    limits: Floats = _limit_speeds(
        edge_lengths(path), tangents, headings, lateral_acceleration, yaw_rate
    )
    return limits


@kernel
def _limit_speeds(
    lengths: Floats,  # (n - 1,)
    tangents: Floats,  # (n - 1, 3)
    headings: Floats,  # (n - 1,)
    lateral_acceleration: float,
    yaw_rate: float,
) -> Floats:
    last = len(lengths) - 1
    limits = np.full(len(lengths) + 1, np.inf)
    bends = _edge_lengths(tangents)  # (n - 2,) change of the tangent
    for k in range(last):
        around = 0.5 * (lengths[k] + lengths[k + 1])
        # The first and last edge may be what a cut left over: their bend belongs to a longer one.
        if k == 0:
            around = max(around, lengths[1])
        if k == last - 1:
            around = max(around, lengths[k])
        bend, turn = bends[k], abs(headings[k + 1] - headings[k])
        if bend > 0.0:
            limits[k + 1] = math.sqrt(lateral_acceleration * around / bend)
        if turn > 0.0:
            limits[k + 1] = min(limits[k + 1], yaw_rate * around / turn)
    return limits


def first_stop(
    path: Floats, s: float, angle: float = SHARP_ANGLE, window: float = SHARP_WINDOW
) -> float:
    """Arc length [m] of the first corner after ``s`` that is too sharp to take in motion.

    A corner is too sharp if the path turns by more than ``angle`` [rad] within ``window`` [m];
    its place is the sharpest turn of that window.

    Returns:
        The place of the corner, or of the path's end if there is none.
    """
    arcs, tangents = arc_lengths(path), edge_tangents(path)
    return float(_first_sharp(arcs, tangents, _edge_at(arcs, s), cosine(angle), window))


@kernel
def _first_sharp(
    arcs: Floats,  # (n,)
    tangents: Floats,  # (n - 1, 3)
    first: int,  # edge
    least_cosine: float,
    window: float,
) -> float:
    for edge in range(first, len(tangents)):
        # The window opens where the edge ends; the path turns most where two edges differ most.
        sharp, corner, least = False, edge + 1, 1.0
        for ahead in range(edge + 1, len(tangents)):
            if arcs[ahead] > arcs[edge + 1] + window:
                break
            sharp = sharp or _cosine(tangents, edge, ahead) < least_cosine
            turn = _cosine(tangents, ahead - 1, ahead)
            if turn < least or ahead == edge + 1:
                corner, least = ahead, turn
        if sharp:
            return float(arcs[corner])
    return float(arcs[-1])


@kernel
def _cosine(tangents: Floats, a: int, b: int) -> float:
    """Of the angle between two edges."""
    return float(
        tangents[a, 0] * tangents[b, 0]
        + tangents[a, 1] * tangents[b, 1]
        + tangents[a, 2] * tangents[b, 2]
    )
