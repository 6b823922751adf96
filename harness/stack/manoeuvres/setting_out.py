"""Leaving rest along the global path: step aside, turn into it, or turn while driving."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from wayproof.harness.decision import Action, Label
from wayproof.harness.geometry import wrap_angle
from wayproof.harness.stack import obstruction
from wayproof.harness.stack.footprint_checks import (
    MIN_PATH,
    headings_to_start_at,
    moves_tail_first,
    poses_from,
)
from wayproof.harness.stack.global_path import heading_at
from wayproof.harness.stack.manoeuvres.driving import (
    drive_along,
    exploration_reason,
    shortened_to_fit,
)
from wayproof.harness.stack.manoeuvres.stopping import wait
from wayproof.harness.stack.obstruction import obstructed
from wayproof.harness.stack.path_timing import plan_trajectory
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.situation import Course
from wayproof.harness.stack.types import Command, Decided, PlannerInput, arc_length
from wayproof.planners import Trajectory, TrajectorySample, truncate, turn_in_place

ALIGNED = 0.05
"""Maximum heading error at which the robot sets out without turning first, rad."""

TURN_CHECK_STEP = 0.1
"""Time between the checked headings of a turn while driving, s."""

MAX_STEP = 0.5
"""Maximum length of a step aside, m."""


def set_out(course: Course) -> Decided | None:
    """Leave rest with an elongated body: nose first, or tail first where it cannot turn about."""
    if not (course.at_rest and course.headed):
        return None
    input, state, start, _, part = course
    path = state.path
    nose_first = heading_at(path, min(0.1, 0.5 * arc_length(path)))
    for target, backwards in headings_to_start_at(input.traversable, start, nose_first):
        error = abs(wrap_angle(target - start.heading))
        if error <= input.behaviour.rotate_in_place_angle:
            driven = drive_along(course, tail_first=backwards)
            if driven is not None:
                return driven
        elif input.gait.sideways_speed:
            driven = _drive_turning(course, tail_first=backwards)
            if driven is not None:
                return driven
        if error > ALIGNED:
            return turn_to(course, target)
    along = plan_trajectory(input, start, truncate(path, part.length), speed_share=1.0)
    reason = _no_room(input, start, along, nose_first)
    return wait(input, replace(state, route=None), start, "no_path", reason)


def step_aside(course: Course) -> Decided | None:
    """Leave rest along the global path at the heading that an elongated body has.

    For a body that can move sideways, and has room at its heading, and not at that of its path.
    """
    input, state, start = course.input, course.state, course.start
    if not (course.is_blocked_at_rest and course.headed):
        return None
    share = input.gait.sideways_speed / input.gait.limits.speed
    path = truncate(state.path, min(MAX_STEP, arc_length(state.path)))
    trajectory = shortened_to_fit(
        input,
        path,
        MIN_PATH,
        lambda way: plan_trajectory(input, start, way, share).facing(start.heading),
    )
    if trajectory is None:
        return None
    reason = Reason("following", free_m=arc_length(trajectory.path))
    command = Command("follow", reason, label="none", trajectory=trajectory, global_path=state.path)
    return Decided(command, state)


def turn_into_path(course: Course) -> Decided | None:
    """Turn in place into the path, with a body at rest that turns before it moves."""
    input, start, path = course.input, course.start, course.state.path
    if not course.at_rest:
        return None
    target = heading_at(path, min(0.2, 0.5 * arc_length(path)))
    error = abs(wrap_angle(target - start.heading))
    return turn_to(course, target) if error > input.behaviour.rotate_in_place_angle else None


def turn_while_driving(course: Course) -> Decided | None:
    """Turn about while driving, with a body in motion tail first that can move sideways."""
    if not moves_tail_first(course.input, course.start, course.state.path):
        return None
    return _drive_turning(course, tail_first=False)


def _drive_turning(course: Course, tail_first: bool) -> Decided | None:
    """Drive the global path and turn into it meanwhile; None if it does not fit until it has."""
    driven = drive_along(course, tail_first)
    turns = driven is not None and _turns_into_path(driven.command.trajectory, tail_first)
    return driven if turns else None


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


def turn_to(course: Course, target: float) -> Decided:
    """Turn in place to a heading, rad; a turn that leads there already continues."""
    input, state, start = course.input, course.state, course.start
    trajectory = state.trajectory
    if not _goes_on_turning(trajectory, start, target):
        trajectory = turn_in_place(
            start.position, input.effect_ns, start.heading, target, input.gait.limits
        )
    action: Action = "follow"
    end = trajectory.at(trajectory.start_ns + math.ceil(trajectory.duration_s * 1e9))
    reason = Reason("turning", turn_rad=wrap_angle(end.heading))
    if state.exploration is not None:
        action, reason = exploration_reason(state, state.path, input)
    label: Label = "localization_lost" if state.returning else "none"
    command = Command(action, reason, label, trajectory, state.path)
    return Decided(command, state)


def _goes_on_turning(trajectory: Trajectory, start: TrajectorySample, target: float) -> bool:
    """Return whether a trajectory under way is a turn in place to a heading, rad."""
    if start.at_rest or arc_length(trajectory.path) > 0.0:
        return False
    end = trajectory.at(trajectory.start_ns + round(trajectory.duration_s * 1e9))
    return abs(wrap_angle(target - end.heading)) <= 0.2


def _no_room(
    input: PlannerInput, start: TrajectorySample, along: Trajectory, target: float
) -> Reason:
    """Return the reason of an elongated body that can neither turn into its path nor follow it.

    Args:
        input: Planner input of the decision.
        start: Start of the new trajectory.
        along: Trajectory along the path at the present heading.
        target: Heading of the path, rad.
    """
    turn = wrap_angle(target - start.heading)
    found = obstruction.on_turn(input, start.position, start.heading, start.heading + turn)
    if found.cell is not None:
        return obstructed("waiting", found)
    found = obstruction.on_poses(input, poses_from(along, 0.0), input.unknown_blocks)
    return obstructed("waiting", found)
