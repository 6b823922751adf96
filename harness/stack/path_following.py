"""Following the global path: commit to its traversable part, turn into it, brake where it ends."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wayproof.harness.geometry import wrap_angle
from wayproof.harness.stack import obstruction
from wayproof.harness.stack.decision import Action, Label
from wayproof.harness.stack.diagnosis import (
    BRAKES,
    WAITS,
    diagnose_driving,
    diagnose_no_room,
    exploration_reason,
    way_ahead_reason,
)
from wayproof.harness.stack.early_bends import bends_early
from wayproof.harness.stack.footprint_checks import (
    MIN_PATH,
    first_misfit,
    headings_to_start_at,
    moves_tail_first,
    poses_from,
    truncate_where_turnable,
)
from wayproof.harness.stack.global_path import STOP_SLACK, heading_at
from wayproof.harness.stack.maneuvers import brake, wait
from wayproof.harness.stack.path_timing import plan_trajectory
from wayproof.harness.stack.pose_step import step_to_pose
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.types import (
    Array,
    Command,
    Decided,
    PlannerInput,
    PlannerState,
    arc_length,
    is_stationary,
)
from wayproof.planners import (
    Trajectory,
    TrajectorySample,
    first_stop,
    remaining,
    stopping_distance,
    truncate,
    turn_in_place,
)

ALIGNED = 0.05
"""Maximum heading error at which the robot sets out without turning first, rad."""

TURN_CHECK_STEP = 0.1
"""Time between the checked headings of a turn while driving, s."""

MAX_SHORTENINGS = 4
"""Number of times that a path is shortened to make the footprint fit along it."""

MISFIT_MARGIN = 0.02
"""Distance kept before the first place where the footprint does not fit, m."""

MAX_STEP = 0.5
"""Maximum length of a step aside, m."""

CORNER_OVERRUN = 0.03
"""Distance beyond a corner within which an elongated body that stops still turns into it, m."""


class DrivablePart(NamedTuple):
    """The part of the global path, from its beginning on, that the robot may drive now.

    Attributes:
        length: Up to what is not traversable, a corner too sharp to drive, or the end, m.
        blocked: Whether what is not traversable ends it.
        too_short: Whether the robot needs more to stop.
    """

    length: float
    blocked: bool
    too_short: bool = False


def follow_global_path(
    input: PlannerInput, state: PlannerState, start: TrajectorySample, previous: PlannerState
) -> Decided:
    """Commit to the traversable part of the global path, ending at rest.

    Args:
        input: Planner input of the decision.
        state: Planner state with the global path from `start` on.
        start: Start of the new trajectory.
        previous: Planner state before the decision, with the last global path.
    """
    path = state.path
    part = drivable_part(input, path, start)
    if part.too_short:
        kept = keep_admitted_trajectory(input, state, start, previous)
        return kept or brake_on_path(input, state, start, part)
    if is_stationary(start) and part.blocked and part.length < input.behaviour.min_advance:
        stepped = step_aside(input, state, start) or step_to_pose(input, state, start)
        return stepped or wait_on_path(input, state, start, part)
    if is_stationary(start) and input.traversable.discs:
        return set_out(input, state, start, part)
    if is_stationary(start) and input.turns_in_place and not input.sideways_speed:
        target = heading_at(path, min(0.2, 0.5 * arc_length(path)))
        if abs(wrap_angle(target - start.heading)) > input.behaviour.rotate_in_place_angle:
            return turn_into_path(input, state, start, target)
    tail_first = moves_tail_first(input, start, path)
    if tail_first and input.sideways_speed:
        turning = turn_while_driving(input, state, start, part, tail_first=False)
        if turning is not None:
            return turning
    driven = drive_along(input, state, start, part, tail_first)
    return driven or keep_course(input, state, start, previous)


def drivable_part(input: PlannerInput, path: Array, start: TrajectorySample) -> DrivablePart:
    """Return the part of a path (n, 3) that is traversable and without a corner to stop at."""
    whole = arc_length(path)
    traversable = input.traversable.free_length(path)
    corner = whole
    rounds_corners = bends_early(input) or (input.sideways_speed and input.turns_in_place)
    if not rounds_corners:
        corner = first_stop(path, 0.0, input.behaviour.max_corner_angle)
    braking = stopping_distance(start.speed, start.acceleration, input.limits)
    overrun = CORNER_OVERRUN if input.traversable.discs else 0.0
    if corner < braking - overrun:  # too late to stop there: the profile slows down for it
        corner = whole
    length = min(traversable, corner, whole)
    return DrivablePart(
        length,
        blocked=length == traversable and traversable < whole,
        too_short=length < braking - STOP_SLACK - (overrun if length == corner else 0.0),
    )


def brake_on_path(
    input: PlannerInput, state: PlannerState, start: TrajectorySample, part: DrivablePart
) -> Decided:
    """Brake: less of the global path can be driven than the robot needs to stop."""
    path, end = state.path, part.length
    braking = stopping_distance(start.speed, start.acceleration, input.limits)
    kept = truncate(path, max(end, 1e-3))
    if not part.blocked:
        reason = Reason("path_too_short", path_m=end, stop_m=braking)
        return brake(input, state, start, path=kept, reason=reason, label="none")
    found = obstruction.on_path(input, path, end, input.unknown_blocks)
    reason, label = way_ahead_reason(BRAKES, found, stop_m=braking)
    return brake(input, state, start, path=kept, reason=reason, label=label)


def wait_on_path(
    input: PlannerInput, state: PlannerState, start: TrajectorySample, part: DrivablePart
) -> Decided:
    """Wait at rest: something blocks the global path before an advance that is worth it."""
    found = obstruction.on_path(input, state.path, part.length, input.unknown_blocks)
    reason, label = way_ahead_reason(WAITS, found, limit_m=input.behaviour.min_advance)
    return wait(input, state, start, label, reason)


def set_out(
    input: PlannerInput, state: PlannerState, start: TrajectorySample, part: DrivablePart
) -> Decided:
    """Leave rest with an elongated body: nose first, or tail first where it cannot turn about."""
    path = state.path
    nose_first = heading_at(path, min(0.1, 0.5 * arc_length(path)))
    for target, backwards in headings_to_start_at(input.traversable, start, nose_first):
        error = abs(wrap_angle(target - start.heading))
        if error <= input.behaviour.rotate_in_place_angle:
            driven = drive_along(input, state, start, part, tail_first=backwards)
            if driven is not None:
                return driven
        elif input.sideways_speed:
            driven = turn_while_driving(input, state, start, part, tail_first=backwards)
            if driven is not None:
                return driven
        if error > ALIGNED:
            return turn_into_path(input, state, start, target)
    along = plan_trajectory(input, start, truncate(path, part.length), speed_share=1.0)
    reason = diagnose_no_room(input, start, along, nose_first)
    return wait(
        input, state=replace(state, global_path=None), start=start, label="no_path", reason=reason
    )


def step_aside(input: PlannerInput, state: PlannerState, start: TrajectorySample) -> Decided | None:
    """Leave rest along the global path at the heading that an elongated body has.

    For a body that has room at its heading, and not at that of its path.

    Returns:
        None if it has no room so either, or cannot move sideways.
    """
    if not input.traversable.discs or not input.sideways_speed:
        return None
    share = input.sideways_speed / input.limits.speed
    path = truncate(state.path, min(MAX_STEP, arc_length(state.path)))
    trajectory = _shortened_to_fit(
        input,
        path,
        MIN_PATH,
        lambda way: plan_trajectory(input, start, way, share).facing(start.heading),
    )
    if trajectory is None:
        return None
    reason = Reason("stepping_aside", distance_m=arc_length(trajectory.path))
    command = Command("follow", reason, label="none", trajectory=trajectory, global_path=state.path)
    return Decided(command, replace(state, trajectory=trajectory, rest_since_ns=-1))


def turn_while_driving(
    input: PlannerInput,
    state: PlannerState,
    start: TrajectorySample,
    part: DrivablePart,
    tail_first: bool,
) -> Decided | None:
    """Drive the global path and turn into it meanwhile, with a body that can move sideways.

    Returns:
        None if the footprint does not fit until it has turned; else as of `drive_along`.
    """
    driven = drive_along(input, state, start, part, tail_first)
    if driven is None:
        return None
    trajectory = driven.command.trajectory
    if input.behaviour.turns_early:
        return driven if _turns_into_path(trajectory, tail_first) else None
    reached = heading_at(trajectory.path, arc_length(trajectory.path))
    left = wrap_angle(reached + (np.pi if tail_first else 0.0) - _final_heading(trajectory))
    return driven if abs(left) <= ALIGNED else None


def _turns_into_path(trajectory: Trajectory, tail_first: bool) -> bool:
    """Return whether the heading is that of the path anywhere along a trajectory.

    At its end it may lag in a bend.
    """
    begin, steps = trajectory.start_ns, math.ceil(trajectory.duration_s / TURN_CHECK_STEP)
    step_ns = round(TURN_CHECK_STEP * 1e9)
    for n in range(steps + 1):
        sample = trajectory.at(begin + n * step_ns)
        course = heading_at(trajectory.path, sample.arc_length) + (np.pi if tail_first else 0.0)
        if abs(wrap_angle(course - sample.heading)) <= ALIGNED:
            return True
    return False


def turn_into_path(
    input: PlannerInput, state: PlannerState, start: TrajectorySample, target: float
) -> Decided:
    """Turn in place to a heading, rad; a turn that leads there already goes on."""
    path = state.path
    trajectory = state.trajectory
    if start.at_rest or abs(wrap_angle(target - _final_heading(trajectory))) > 0.2:
        trajectory = turn_in_place(
            start.position, input.effect_ns, start.heading, target, input.limits
        )
    action: Action = "follow"
    reason = Reason("turning_into_path", turn_rad=wrap_angle(target - start.heading))
    if state.exploration is not None:
        action, reason = exploration_reason(state, path, input)
    label: Label = "localization_lost" if state.returning else "none"
    command = Command(action, reason, label, trajectory, path)
    return Decided(command, replace(state, trajectory=trajectory, rest_since_ns=-1))


def keep_admitted_trajectory(
    input: PlannerInput, state: PlannerState, start: TrajectorySample, previous: PlannerState
) -> Decided | None:
    """Keep the last trajectory of an elongated body in motion that need not brake for the path.

    As where it steps aside, at a heading that is not that of its path.

    Returns:
        None if the footprint does not fit along the trajectory to its rest.
    """
    keeps = input.behaviour.keeps_admitted_trajectories and input.traversable.discs
    if not keeps or is_stationary(start) or not _fits(input, previous.trajectory):
        return None
    return _kept(state, previous)


def _fits(input: PlannerInput, trajectory: Trajectory) -> bool:
    """Return whether the footprint fits along the rest of a trajectory."""
    elapsed = (input.effect_ns - trajectory.start_ns) * 1e-9
    corners = input.behaviour.checks_corners
    return first_misfit(input.traversable, trajectory, elapsed, corners=corners) is None


def _kept(state: PlannerState, previous: PlannerState) -> Decided:
    """Return the decision to follow the last trajectory."""
    command = Command(
        "follow",
        Reason("keeping_course"),
        label="none",
        trajectory=previous.trajectory,
        global_path=previous.global_path,
    )
    return Decided(command, replace(previous, improved_ns=state.improved_ns))


def keep_course(
    input: PlannerInput, state: PlannerState, start: TrajectorySample, previous: PlannerState
) -> Decided:
    """Keep the last trajectory if the footprint fits along it, else stop on it.

    For an elongated body in motion that does not fit along the new path.
    """
    trajectory = previous.trajectory
    if _fits(input, trajectory):
        return _kept(state, previous)
    if input.behaviour.goes_on_shortened:
        driven = _drive_last_path(input, state, start, previous)
        if driven is not None:
            return driven
    elapsed = (input.effect_ns - trajectory.start_ns) * 1e-9
    corners = input.behaviour.checks_corners
    poses = poses_from(trajectory, elapsed, corners=corners)
    found = obstruction.on_poses(input, poses, input.unknown_blocks)
    path = remaining(trajectory.path, start.arc_length)
    stop = stopping_distance(start.speed, start.acceleration, input.limits)
    reason, label = way_ahead_reason(BRAKES, found, stop_m=stop)
    return brake(input, state, start, path, reason, label)


def _drive_last_path(
    input: PlannerInput, state: PlannerState, start: TrajectorySample, previous: PlannerState
) -> Decided | None:
    """Drive the last global path as far as it still fits; None if that is too short to stop."""
    if previous.global_path is None:
        return None
    path = remaining(previous.global_path, start.arc_length)
    part = drivable_part(input, path, start)
    if part.too_short:
        return None
    state = replace(previous, global_path=path, improved_ns=state.improved_ns)
    tail_first = moves_tail_first(input, start, path)
    return drive_along(input, state, start, part, tail_first)


def drive_along(
    input: PlannerInput,
    state: PlannerState,
    start: TrajectorySample,
    part: DrivablePart,
    tail_first: bool,
) -> Decided | None:
    """Drive a part of the global path.

    Args:
        input: Planner input of the decision.
        state: Planner state with the global path.
        start: Start of the new trajectory.
        part: Part of that path.
        tail_first: Whether an elongated body moves backwards.

    Returns:
        None if the footprint does not fit, or along too little of it.
    """
    path = truncate(state.path, part.length)
    if tail_first:
        braking = stopping_distance(start.speed, start.acceleration, input.limits)
        path = truncate_where_turnable(input.traversable, path, braking)
    unknown_ahead = input.penalize_unknown and input.known_free.free_length(path) < arc_length(path)
    share = input.behaviour.unknown_speed_fraction if unknown_ahead else 1.0
    if input.uncertain or input.noisy:
        share = min(share, input.behaviour.uncertain_speed_fraction)
    trajectory = fit_trajectory(input, start, path, share, tail_first)
    if trajectory is None:
        return None
    action, reason, label = diagnose_driving(
        input, state, start, part.length, blocked=part.blocked, slowed=unknown_ahead
    )
    command = Command(action, reason, label, trajectory, state.path)
    return Decided(command, replace(state, trajectory=trajectory, rest_since_ns=-1))


def fit_trajectory(
    input: PlannerInput, start: TrajectorySample, path: Array, speed_share: float, tail_first: bool
) -> Trajectory | None:
    """Plan a trajectory along a path, shortened to where the footprint fits at each heading.

    Returns:
        None if that leaves less than the robot needs to stop.
    """
    if tail_first:
        speed_share = min(speed_share, input.behaviour.reverse_speed_fraction)
    if input.traversable.discs:
        speed_share = min(speed_share, input.behaviour.narrow_speed_fraction)
    braking = stopping_distance(start.speed, start.acceleration, input.limits)
    return _shortened_to_fit(
        input,
        path,
        max(braking, MIN_PATH),
        lambda way: plan_trajectory(
            input, start, path=way, speed_share=speed_share, tail_first=tail_first
        ),
    )


def _shortened_to_fit(
    input: PlannerInput, path: Array, least: float, plan: Callable[[Array], Trajectory]
) -> Trajectory | None:
    """Plan along a path (n, 3), shortened until the footprint fits; None below `least`, m."""
    for _ in range(MAX_SHORTENINGS):
        trajectory = plan(path)
        misfit = first_misfit(input.traversable, trajectory, corners=input.behaviour.checks_corners)
        if misfit is None:
            return trajectory
        end = misfit - MISFIT_MARGIN
        if end < least:
            return None
        path = truncate(path, end)
    return None


def _final_heading(trajectory: Trajectory) -> float:
    return trajectory.at(trajectory.start_ns + round(trajectory.duration_s * 1e9)).heading
