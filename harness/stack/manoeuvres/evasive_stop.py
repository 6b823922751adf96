"""The path to stop along when the way ahead is no longer free: the old path, or a bend off it.

A stop from full speed takes about a metre. If something has come into that metre, straight on is
the one way that surely leads to it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from wayproof.harness.stack.types import Array, PlannerInput, arc_length, is_free_along
from wayproof.maps.elementary import norm, sines_cosines
from wayproof.planners import (
    TrajectorySample,
    stopping_distance,
    stopping_speeds,
    tangent_at,
    truncate,
)
from wayproof.planners.path import edge_tangents

STEP = 0.05
"""Spacing of the points of a bend, m."""

MIN_SPEED = 0.1
"""Speed added to the speed that is left, so that no bend is a turn on the spot, m/s."""

EMERGENCY = 1.5
"""Lateral acceleration of a bend to its limit at the speed that is left in a stop of limited jerk:
gentler bends evade people less well, and at 2.2 a drone turned over."""

MIN_EVASION_SPEED = 0.3
"""Speed below which the robot stops within centimetres, wherever it turns, m/s."""


def clearest_stop(input: PlannerInput, start: TrajectorySample, path: Array) -> Array:
    """Return the path to stop along: the one given, unless it leads where the robot may not be.

    Then it is the bend that keeps farthest from what is blocked, on the way and at its end, if
    that is farther than the path does; of those bends that come no nearer on the way.

    Args:
        input: Planner input of the decision.
        start: Start of the new trajectory.
        path: (n, 3) that the robot would stop along, m.

    Returns:
        (m, 3) from the same position on, m.
    """
    reach = stopping_distance(start.speed, start.acceleration, input.gait.limits)
    ahead = _with_length(path, reach)
    free = is_free_along(input.traversable, ahead)
    if start.speed < MIN_EVASION_SPEED or free:
        return path
    bends = _bends(input, start, tangent_at(path, 0.0), reach)
    paths = [ahead, *(_with_length(bend, reach) for bend in bends)]  # chords are shorter
    clearances = [_clearance(input, one) for one in paths]
    least = clearances[0].along
    kept = [one.along + one.at_end if one.along >= least else -np.inf for one in clearances]
    best = int(np.argmax(kept))  # of equals the first
    return paths[best] if best else path


def _with_length(path: Array, length: float) -> Array:
    """Return a path cut to a length, or prolonged to it in its last direction, m."""
    beyond = length - arc_length(path)
    if beyond <= 0.0:
        return truncate(path, length)
    return np.vstack([path, path[-1] + beyond * tangent_at(path, arc_length(path))])


class _Clearance(NamedTuple):
    """Distance of a path from blocked cells, m."""

    along: float  # the least
    at_end: float


def _clearance(input: PlannerInput, path: Array) -> _Clearance:
    space = input.traversable
    if not space.discs:
        return _Clearance(space.least_clearance(path), space.least_clearance(path[[-1, -1]]))
    # A long body swings its ends out where it bends.
    ahead = edge_tangents(path)[[*range(len(path) - 1), -1]]
    paths = [path + disc.offset * ahead for disc in space.discs]
    return _Clearance(
        min(space.least_clearance(one) for one in paths),
        min(space.least_clearance(one[[-1, -1]]) for one in paths),
    )


def _bends(
    input: PlannerInput, start: TrajectorySample, tangent: Array, reach: float
) -> list[Array]:
    """Return paths (n, 3) that bend to the left and right, and up and down for a flying robot.

    Each at the tightest curvature that the robot can take at the speed that is left, and at half
    of it; at most by a right angle.
    """
    limits = input.gait.limits
    arcs = np.linspace(0.0, reach, max(round(reach / STEP), 1) + 1)  # (n,)
    speeds = start.speed * np.sqrt(np.maximum(1.0 - arcs / reach, 0.0)) + MIN_SPEED
    late = stopping_speeds(start.speed, start.acceleration, limits, arcs) + MIN_SPEED
    tightest = limits.lateral_acceleration / (speeds * speeds)  # (n,) 1/m
    tightest = np.minimum(tightest, EMERGENCY * limits.lateral_acceleration / (late * late))
    left = np.array([-tangent[1], tangent[0], 0.0])
    if not left.any():  # straight up or down
        left = np.array([0.0, 1.0, 0.0])
    left /= norm(left)
    sides = [left, -left]
    if input.gait.in_plane:  # it moves where it faces
        tightest = np.minimum(tightest, limits.yaw_rate / speeds)
    else:
        up = np.cross(tangent, left)
        sides += [up, -up]
    bends = []
    for curvature in (0.5 * tightest, tightest):
        turned = np.minimum(_integral(curvature, arcs), 0.5 * np.pi)
        sines, cosines = sines_cosines(turned)
        along, aside = _integral(cosines, arcs), _integral(sines, arcs)
        bends += [
            start.position + np.outer(along, tangent) + np.outer(aside, side) for side in sides
        ]
    return bends


def _integral(values: Array, at: Array) -> Array:
    """Return the integral (n,) from the first place on, by the trapezoidal rule."""
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(at)
    return np.concatenate([[0.0], np.cumsum(steps)])
