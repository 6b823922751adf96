"""Leaving the inflation: straight out of it, or by a turn in place."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wayproof.harness.geometry import wrap_angle
from wayproof.harness.stack import obstruction
from wayproof.harness.stack.footprint_checks import (
    footprint_free,
    keeps_bare_clearance,
    keeps_clearance,
)
from wayproof.harness.stack.manoeuvres.stopping import wait
from wayproof.harness.stack.obstruction import obstructed
from wayproof.harness.stack.path_timing import plan_trajectory
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.situation import Situation
from wayproof.harness.stack.state import PlannerState, UnderWay
from wayproof.harness.stack.types import (
    Array,
    Command,
    Decided,
    PlannerInput,
    arc_length,
    distance,
    is_stationary,
)
from wayproof.planners import Trajectory, TrajectorySample, remaining, turn_in_place

MAX_ESCAPE = 1.0
"""Maximum length of a way out of the inflation, m."""

ESCAPE_TURNS = [sign * 0.1 * n for n in range(1, 9) for sign in (1, -1)]
"""Turns in place tried to get out of the inflation, rad."""

ESCAPE_SPEED_SHARE = 0.2
"""Share of full speed at which the robot leaves the inflation, in any direction."""


def escape_inflation(situation: Situation) -> Decided | None:
    """Move straight to the nearest traversable position, or turn in place if that is nearer.

    For a body at rest inside the inflation. Where there is no way out, or the way leads nearer to
    what blocks, it waits.
    """
    input, state, start = situation.input, situation.state, situation.start
    if not is_stationary(start) or footprint_free(input.traversable, start):
        return None
    escape = _nearest_escape(input, start)
    found = obstruction.at_place(input, start.position, start.heading, input.unknown_blocks)
    if escape is None or not _leads_out(input, start, escape.position, escape.heading):
        return wait(input, state, start, "start_blocked", obstructed("leaving_inflation", found))
    path = np.stack([start.position, escape.position])
    state = replace(state, route=None)
    if escape.heading == start.heading:
        away = distance(start.position, escape.position)
        reason = obstructed("leaving_inflation", found, distance_m=away)
        return _escaping(state, _sidestep(input, start, path), path, reason, "escape")
    trajectory = turn_in_place(
        start.position, input.effect_ns, start.heading, escape.heading, input.gait.limits
    )
    turn = wrap_angle(escape.heading - start.heading)
    reason = obstructed("leaving_inflation", found, turn_rad=turn)
    return _escaping(state, trajectory, path, reason)


def continue_escape(situation: Situation) -> Decided | None:
    """Move on along an escape that is under way, as long as it leads out of the inflation."""
    input, state, start = situation.input, situation.state, situation.start
    space = input.traversable
    if is_stationary(start) or state.under_way != "escape" or footprint_free(space, start):
        return None
    path = remaining(state.trajectory.path, start.arc_length)
    if not footprint_free(space, start._replace(position=path[-1])):
        return None
    if not _leads_out(input, start, path[-1], start.heading):
        return None
    found = obstruction.at_place(input, start.position, start.heading, input.unknown_blocks)
    reason = obstructed("leaving_inflation", found, distance_m=arc_length(path))
    return _escaping(state, _sidestep(input, start, path), path, reason, "escape")


def _escaping(
    state: PlannerState,
    trajectory: Trajectory,
    path: Array,
    reason: Reason,
    under_way: UnderWay = "",
) -> Decided:
    """Return the decision to leave the inflation by a trajectory along a path (n, 3)."""
    command = Command(
        "recover", reason, "start_blocked", trajectory, global_path=path, under_way=under_way
    )
    return Decided(command, state)


def _leads_out(input: PlannerInput, start: TrajectorySample, target: Array, heading: float) -> bool:
    """Return whether a straight motion to a pose leads no nearer to the cells that block it.

    Away from the unknown may be towards an obstacle, which is worse.
    """
    spaces = (input.traversable, input.optimistic)
    if not all(keeps_clearance(space, start, target, heading) for space in spaces):
        return False
    return keeps_bare_clearance(input.optimistic, input.gait.discs, start, target, heading)


def _sidestep(input: PlannerInput, start: TrajectorySample, path: Array) -> Trajectory:
    """Return a slow motion along a path (n, 3), at the heading at which the bare discs fit."""
    trajectory = plan_trajectory(input, start, path, ESCAPE_SPEED_SHARE)
    still = len(input.gait.discs) > 1 or bool(input.gait.sideways_speed)
    return trajectory.facing(start.heading) if still else trajectory


class _Pose(NamedTuple):
    """A position (3,), m, and a heading, rad."""

    position: Array
    heading: float


def _nearest_escape(input: PlannerInput, start: TrajectorySample) -> _Pose | None:
    """Return the nearest traversable position at this heading, or the nearest heading here."""
    space = input.traversable
    if not space.discs:
        position = space.nearest_free(start.position, MAX_ESCAPE)
        return None if position is None else _Pose(position, start.heading)
    pose = space.nearest_pose(start.position, MAX_ESCAPE, np.array([start.heading]))
    moved = np.inf if pose is None else distance(start.position, pose[:3])
    for turn in ESCAPE_TURNS:
        if abs(turn) < moved and space.pose_free(start.position, start.heading + turn):
            return _Pose(start.position, start.heading + turn)
    return None if pose is None else _Pose(pose[:3], start.heading)
