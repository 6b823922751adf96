"""Where to stop when the way ahead is no longer free: on the old path, or turning away from it.

A stop takes a metre from full speed. If something has come into that metre, straight on is the one
way that surely leads to it.
"""

from __future__ import annotations

import numpy as np

from harness.view import Array, View, length
from planners import TrajectorySample, stopping_distance, tangent_at, truncate

STEP = 0.05
"""Between the points of a way that turns away, m."""

SLOWEST = 0.3
"""From a lower speed the robot stops within some centimetres, wherever it turns, m/s."""


def clearest_stop(view: View, now: TrajectorySample, path: Array) -> Array:
    """The path to stop along: the one given, unless it leads where the robot may not be.

    Then it is one of the arcs that the robot can turn into from its state: the one that keeps
    farthest from what is blocked, on the way and at its end, if by a cell farther than the path.

    Args:
        view: Of the decision.
        now: Where the robot will be.
        path: (n, 3) that it would stop along, from there, m.

    Returns:
        (m, 3), from there.
    """
    reach = stopping_distance(now.speed, now.acceleration, view.limits)
    ahead = _as_long(path, reach)
    if now.speed < SLOWEST or view.admitted.free_length(ahead) >= length(ahead) - 1e-6:
        return path
    arcs = _arcs(view, now, tangent_at(path, 0.0), reach)
    kept = [_kept_off(view, arc) for arc in arcs]
    best = int(np.argmax(kept))
    if kept[best] <= _kept_off(view, ahead) + view.admitted.resolution:
        return path
    return arcs[best]


def _as_long(path: Array, reach: float) -> Array:
    """The first part of a path, or the path and its last direction beyond, m."""
    beyond = reach - length(path)
    if beyond <= 0.0:
        return truncate(path, reach)
    return np.vstack([path, path[-1] + beyond * tangent_at(path, length(path))])


def _kept_off(view: View, path: Array) -> float:
    """How far a way keeps from what is blocked, m: where it is nearest, and where it ends."""
    space = view.admitted
    return space.least_clearance(path) + space.least_clearance(path[[-1, -1]])


def _arcs(view: View, now: TrajectorySample, tangent: Array, reach: float) -> list[Array]:
    """Arcs (n, 3) to the left and right, of a flying robot up and down too; half and all it can."""
    limits = view.limits
    tightest = min(limits.lateral_acceleration / now.speed**2, limits.yaw_rate / now.speed)
    left = np.array([-tangent[1], tangent[0], 0.0])
    if not left.any():  # straight up or down
        left = np.array([0.0, 1.0, 0.0])
    left /= np.sqrt(left @ left)
    sides = [left, -left]
    if not view.turns_in_place:
        up = np.cross(tangent, left)
        sides += [up, -up]
    arc_lengths = np.linspace(0.0, reach, max(round(reach / STEP), 1) + 1)[:, None]  # (n, 1)
    return [
        now.position
        + np.sin(curvature * arc_lengths) / curvature * tangent
        + (1.0 - np.cos(curvature * arc_lengths)) / curvature * side
        for curvature in (0.5 * tightest, tightest)
        for side in sides
    ]
