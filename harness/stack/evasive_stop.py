"""Where to stop when the way ahead is no longer free: on the old path, or turning away from it.

A stop takes a metre from full speed. If something has come into that metre, straight on is the one
way that surely leads to it.
"""

from __future__ import annotations

import numpy as np

from wayproof.harness.stack.types import Array, View, length
from wayproof.maps.elementary import norm, sines_cosines
from wayproof.planners import TrajectorySample, stopping_distance, tangent_at, truncate

STEP = 0.05
"""Between the points of a bend, m."""

LEAST_SPEED = 0.1
"""Added to the speed that is left, so that no bend is a turn on the spot, m/s."""

SLOWEST = 0.3
"""From a lower speed the robot stops within some centimetres, wherever it turns, m/s."""


def clearest_stop(view: View, now: TrajectorySample, path: Array) -> Array:
    """The path to stop along: the one given, unless it leads where the robot may not be.

    Then it is one of the bends that the robot can take from its state: the one that keeps farthest
    from what is blocked, on the way and at its end, if that is farther than the path.

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
    ways = [ahead, *_bends(view, now, tangent_at(path, 0.0), reach)]
    best = int(np.argmax([_kept_off(view, way) for way in ways]))  # of equals the first
    return ways[best] if best else path


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


def _bends(view: View, now: TrajectorySample, tangent: Array, reach: float) -> list[Array]:
    """Ways (n, 3) that bend to the left and right, of a flying robot up and down too.

    Each as tightly as the robot can at the speed that is left, and half as tightly; at most by a
    right angle.
    """
    limits = view.limits
    arcs = np.linspace(0.0, reach, max(round(reach / STEP), 1) + 1)  # (n,)
    speeds = now.speed * np.sqrt(np.maximum(1.0 - arcs / reach, 0.0)) + LEAST_SPEED
    tightest = limits.lateral_acceleration / (speeds * speeds)  # (n,) 1/m
    left = np.array([-tangent[1], tangent[0], 0.0])
    if not left.any():  # straight up or down
        left = np.array([0.0, 1.0, 0.0])
    left /= norm(left)
    sides = [left, -left]
    if view.turns_in_place:  # it goes where it faces
        tightest = np.minimum(tightest, limits.yaw_rate / speeds)
    else:
        up = np.cross(tangent, left)
        sides += [up, -up]
    bends = []
    for curvature in (0.5 * tightest, tightest):
        turned = np.minimum(_summed(curvature, arcs), 0.5 * np.pi)
        sines, cosines = sines_cosines(turned)
        along, aside = _summed(cosines, arcs), _summed(sines, arcs)
        bends += [now.position + np.outer(along, tangent) + np.outer(aside, to) for to in sides]
    return bends


def _summed(values: Array, at: Array) -> Array:
    """Integral (n,) from the first place on, by the trapezoidal rule."""
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(at)
    return np.concatenate([[0.0], np.cumsum(steps)])
