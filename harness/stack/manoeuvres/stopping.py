"""Coming to rest, and staying there: wait, brake, stop without a path.

A stop from full speed takes about a metre. If something has come into that metre, straight on is
the one way that surely leads to it: then the stop bends off the old path.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wayproof.harness.decision import Label
from wayproof.harness.stack import obstruction
from wayproof.harness.stack.footprint_checks import first_misfit, moves_tail_first
from wayproof.harness.stack.global_path import ARRIVED, GlobalPlan
from wayproof.harness.stack.obstruction import braking_reason, obstructed
from wayproof.harness.stack.path_timing import at_begin
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.situation import Situation
from wayproof.harness.stack.state import PlannerState
from wayproof.harness.stack.types import (
    LENGTH_ROUNDING,
    Array,
    Command,
    Decided,
    PlannerInput,
    arc_length,
    is_free_along,
    is_stationary,
)
from wayproof.maps.elementary import norm, sines_cosines
from wayproof.planners import (
    Plan,
    Trajectory,
    TrajectorySample,
    hold,
    remaining,
    stop_along,
    stopping_distance,
    stopping_speeds,
    tangent_at,
    truncate,
)
from wayproof.planners.path import edge_tangents


def wait(
    input: PlannerInput,
    state: PlannerState,
    start: TrajectorySample,
    label: Label,
    reason: Reason,
) -> Decided:
    """Stay at rest until the map changes; the reason gets the time waited."""
    trajectory = hold(start.position, input.effect_ns, start.heading)
    since_ns = state.rest_since_ns if state.rest_since_ns >= 0 else input.time_ns
    state = replace(state, rest_since_ns=since_ns)
    reason = replace(reason, waited_s=seconds_waited(input, state))
    return Decided(Command("stop_and_wait", reason, label, trajectory, state.global_path), state)


def seconds_waited(input: PlannerInput, state: PlannerState) -> float:
    """Time for which the robot has waited at rest, s."""
    return (input.time_ns - state.rest_since_ns) * 1e-9


def brake(
    input: PlannerInput,
    state: PlannerState,
    start: TrajectorySample,
    path: Array,
    reason: Reason,
    label: Label,
) -> Decided:
    """Stop along a path (n, 3), or on a bend away from it where something has come into it."""
    path = clearest_stop(input, start, path)
    tail_first = moves_tail_first(input, start, path)
    stop = stop_along(path, at_begin(input, start), input.gait.limits, tail_first)
    trajectory = _without_turn(input, start, stop)
    if reason.kind == "braking_for_goal":
        reason = replace(reason, path_m=arc_length(trajectory.path))
    command = Command("stop_and_wait", reason, label, trajectory)
    return Decided(command, replace(state, route=None))


def _without_turn(input: PlannerInput, start: TrajectorySample, stop: Trajectory) -> Trajectory:
    """Return a stop at the heading that the body has, if it fits so, and not as it turns."""
    if first_misfit(input.traversable, stop) is None:
        return stop
    still = stop.facing(start.heading)
    return still if first_misfit(input.traversable, still) is None else stop


def stop_without_path(situation: Situation) -> Decided | None:
    """Brake along the last trajectory; at rest, wait for the map to change.

    Where there is no global path: it was lost, or a search found none.
    """
    planned, start = situation.planned, situation.start
    if planned.state.route is not None:
        return None
    input, state, search = situation.heading_for, planned.state, planned.search
    path = remaining(state.trajectory.path, start.arc_length)
    if search is None:
        reason, label = _lost_path(input, situation.state, start)
        return brake(input, state, start, path, reason, label)
    reason = _no_path(input, search)
    if is_stationary(start):
        decided = wait(input, state, start, search.label, reason)
    else:
        decided = brake(input, state, start, path, reason, search.label)
    return searched(decided, planned)


def searched(decided: Decided, planned: GlobalPlan) -> Decided:
    """Return a decision whose command names the search that it rests on, if one was made."""
    command = replace(decided.command, search=planned.search, search_seed=planned.seed)
    return decided._replace(command=command)


def _no_path(input: PlannerInput, search: Plan) -> Reason:
    """Return the reason of a robot for which no path to the goal was found."""
    if search.label == "goal_blocked":
        found = obstruction.at_place(input, input.goal, 0.0, unknown_blocks=False)
        return obstructed("goal_blocked", found)
    return Reason("no_path", iterations=search.iterations)


def _lost_path(
    input: PlannerInput, previous: PlannerState, start: TrajectorySample
) -> tuple[Reason, Label]:
    """Return the reason and label of a robot in motion without a global path.

    Args:
        input: Planner input of the decision.
        previous: State before it; it has the path, unless an earlier decision dropped that.
        start: Start of the new trajectory.
    """
    if previous.global_path is None:
        return _earlier_loss(input, previous)
    path = remaining(previous.global_path, start.arc_length)
    if previous.exploring and arc_length(path) < ARRIVED:  # at its viewpoint
        return Reason("waiting", since=input.sequence), "none"
    stop = stopping_distance(start.speed, start.acceleration, input.gait.limits)
    free = input.traversable.free_length(path)
    bendable = min(stop, arc_length(path) - LENGTH_ROUNDING)
    if free < bendable:  # no stretch of it is left that could be bent
        return braking_reason(obstruction.on_path(input, path, free, input.unknown_blocks))
    return Reason("braking_for_goal"), "none"  # which has another place now


def _earlier_loss(input: PlannerInput, previous: PlannerState) -> tuple[Reason, Label]:
    """Return the reason and label where an earlier decision dropped the path."""
    loss = previous.path_loss
    if loss is None:  # a robot in motion without a path has had none from the start
        return Reason("waiting", since=input.sequence), "none"
    return Reason("waiting", since=loss.sequence), loss.label


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
