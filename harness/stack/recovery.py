"""Recovery manoeuvres: escape from the inflation, explore a frontier, backtrack, abort."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wayproof.harness.geometry import wrap_angle
from wayproof.harness.stack import obstruction
from wayproof.harness.stack.backtrack import backtrack_path
from wayproof.harness.stack.diagnosis import obstructed
from wayproof.harness.stack.footprint_checks import (
    footprint_free,
    keeps_bare_clearance,
    keeps_clearance,
)
from wayproof.harness.stack.global_path import drop_duplicates
from wayproof.harness.stack.maneuvers import seconds_waited, wait
from wayproof.harness.stack.path_following import follow_global_path
from wayproof.harness.stack.path_timing import plan_trajectory
from wayproof.harness.stack.types import (
    Array,
    Command,
    Decided,
    Exploration,
    PlannerInput,
    PlannerState,
    UnderWay,
    arc_length,
    distance,
    is_stationary,
)
from wayproof.planners import (
    Plan,
    Trajectory,
    TrajectorySample,
    best_frontier,
    blend_corners,
    plan,
    plan_seed,
    remaining,
    turn_in_place,
)

MAX_ESCAPE = 1.0
"""Maximum length of a way out of the inflation, m."""

ESCAPE_TURNS = [sign * 0.1 * n for n in range(1, 9) for sign in (1, -1)]
"""Turns in place tried to get out of the inflation, rad."""

ESCAPE_SPEED_SHARE = 0.2
"""Share of full speed at which the robot leaves the inflation, in any direction."""

MAX_FRONTIERS = 4
"""Number of frontiers that an elongated body, which cannot get to each, tries to plan to."""


def escape_inflation(input: PlannerInput, state: PlannerState, start: TrajectorySample) -> Decided:
    """Move straight to the nearest traversable position, or turn in place if that is nearer.

    For a body at rest inside the inflation. Where there is no way out, or the way leads nearer to
    what blocks, it waits.
    """
    escape = _nearest_escape(input, start)
    found = obstruction.at_place(input, start.position, start.heading, input.unknown_blocks)
    if escape is None or not _leads_out(input, start, escape.position, escape.heading):
        return wait(input, state, start, "start_blocked", obstructed("leaving_inflation", found))
    away = distance(start.position, escape.position)
    path = np.stack([start.position, escape.position])
    under_way: UnderWay = ""
    if escape.heading == start.heading:
        trajectory = _sidestep(input, start, path)
        reason = obstructed("leaving_inflation", found, distance_m=away)
        under_way = "escape"
    else:
        trajectory = turn_in_place(
            start.position, input.effect_ns, start.heading, escape.heading, input.limits
        )
        turn = wrap_angle(escape.heading - start.heading)
        reason = obstructed("leaving_inflation", found, turn_rad=turn)
    command = Command(
        "recover",
        reason,
        label="start_blocked",
        trajectory=trajectory,
        global_path=path,
        under_way=under_way,
    )
    state = replace(
        state, trajectory=trajectory, global_path=None, exploration=None, rest_since_ns=-1
    )
    return Decided(command, state)


def is_escaping(input: PlannerInput, state: PlannerState, start: TrajectorySample) -> bool:
    """Return whether a body in motion inside the inflation is on its way out of it."""
    return (
        not is_stationary(start)
        and state.path_loss is not None
        and state.path_loss.under_way == "escape"
        and not footprint_free(input.traversable, start)
    )


def continue_escape(
    input: PlannerInput, state: PlannerState, start: TrajectorySample
) -> Decided | None:
    """Move on along an escape that is under way; None if it has ceased to lead out."""
    path = remaining(state.trajectory.path, start.arc_length)
    if not footprint_free(input.traversable, start._replace(position=path[-1])):
        return None
    if not _leads_out(input, start, path[-1], start.heading):
        return None
    found = obstruction.at_place(input, start.position, start.heading, input.unknown_blocks)
    reason = obstructed("leaving_inflation", found, distance_m=arc_length(path))
    trajectory = _sidestep(input, start, path)
    command = Command(
        "recover",
        reason,
        label="start_blocked",
        trajectory=trajectory,
        global_path=path,
        under_way="escape",
    )
    return Decided(command, replace(state, trajectory=trajectory))


def _leads_out(input: PlannerInput, start: TrajectorySample, target: Array, heading: float) -> bool:
    """Return whether a straight motion to a pose leads no nearer to the cells that block it.

    Away from the unknown may be towards an obstacle, which is worse.
    """
    spaces = (input.traversable, input.optimistic)
    if not all(keeps_clearance(space, start, target, heading) for space in spaces):
        return False
    return keeps_bare_clearance(input.optimistic, input.bare_discs, start, target, heading)


def _sidestep(input: PlannerInput, start: TrajectorySample, path: Array) -> Trajectory:
    """Return a slow motion along a path (n, 3), at the heading at which the bare discs fit."""
    trajectory = plan_trajectory(input, start, path, ESCAPE_SPEED_SHARE)
    still = len(input.bare_discs) > 1 or bool(input.sideways_speed)
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


def recover_after_timeout(
    input: PlannerInput, start: TrajectorySample, decided: Decided
) -> Decided:
    """Explore instead of waiting longer than the timeout; abort after the last exploration.

    Args:
        input: Planner input of the decision.
        start: Start of the new trajectory.
        decided: Decision by a manoeuvre; returned unchanged unless it waits.
    """
    command, state = decided
    waits = command.reason.waited_s is not None
    if not waits or seconds_waited(input, state) < input.behaviour.wait_timeout:
        return decided
    if len(state.viewpoints) >= input.behaviour.max_recoveries:
        return abort(command, state)
    return explore_frontier(input, start, decided)


def abort(command: Command, state: PlannerState) -> Decided:
    """Give the mission up: the robot has explored from as many viewpoints as it may."""
    reason = replace(command.reason, places=len(state.viewpoints))
    return Decided(replace(command, action="abort", reason=reason), state)


def explore_frontier(input: PlannerInput, start: TrajectorySample, waiting: Decided) -> Decided:
    """Leave for the best frontier within reach; without one backtrack, or else wait once more.

    Args:
        input: Planner input of the decision.
        start: Start of the new trajectory, at rest.
        waiting: Command and state of the wait that has lasted too long.
    """
    command, state = waiting
    viewpoints = np.vstack([state.viewpoints, start.position])
    state = replace(state, viewpoints=viewpoints, rest_since_ns=-1)
    seed = plan_seed(input.seed, "errand", input.sequence)
    search = _search_frontier(input, start, viewpoints, seed)
    if search is None or search.waypoints is None:
        path = backtrack_path(input, state, start)
        if path is not None:
            return backtrack(input, state, start, path)
        frontier = "none" if search is None else "out_of_reach"
        reason = replace(command.reason, frontier=frontier)
        command = replace(command, reason=reason, global_path=None)
        return Decided(command, replace(state, global_path=None, exploration=None))
    path = blend_corners(
        input.traversable, drop_duplicates(search.waypoints), input.behaviour.blend_length
    )
    exploration = Exploration(input.sequence)
    state = replace(state, global_path=path, exploration=exploration, improved_ns=input.time_ns)
    command, state = follow_global_path(input, state, start, previous=state)
    return Decided(replace(command, search=search, search_seed=seed), state)


def _search_frontier(
    input: PlannerInput, start: TrajectorySample, viewpoints: Array, seed: int
) -> Plan | None:
    """Return the path to the best frontier that can be reached; None if no frontier is left."""
    search = None
    for _ in range(MAX_FRONTIERS if input.traversable.discs else 1):
        target = best_frontier(
            input.traversable, input.optimistic, start.position, input.goal, visited=viewpoints
        )
        if target is None:
            return search
        search = plan(
            input.traversable,
            start=start.position,
            goal=target,
            config=input.planner,
            seed=seed,
            heading=start.heading,
        )
        if search.waypoints is not None:
            return search
        viewpoints = np.vstack([viewpoints, target])
    return search


def backtrack(
    input: PlannerInput, state: PlannerState, start: TrajectorySample, path: Array
) -> Decided:
    """Go back along a path (n, 3) of breadcrumbs, to explore from there."""
    state = replace(
        state,
        global_path=path,
        exploration=Exploration(input.sequence, backtracking=True),
        improved_ns=input.time_ns,
        backtracks=state.backtracks + 1,
    )
    return follow_global_path(input, state, start, previous=state)
