"""A step to the first pose of a way planned with headings, from a rest in a narrow place."""

from __future__ import annotations

import dataclasses
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from wayproof.harness.geometry import wrap_angle
from wayproof.harness.stack.course import Course
from wayproof.harness.stack.footprint_checks import first_misfit
from wayproof.harness.stack.path_timing import plan_trajectory
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.situation import Situation
from wayproof.harness.stack.state import PlannerState
from wayproof.harness.stack.types import Array, Command, Decided, PlannerInput, arc_length, distance
from wayproof.planners import Trajectory, TrajectorySample, plan, plan_seed, turn_in_place

STANDS = 1e-6
"""Distance below which a pose is a turn on the spot, m."""

LEAST_TURN = 0.02
"""Smallest turn on the spot that is made for itself, rad."""

LONGEST_STEP = 0.5
"""Longest step, m."""

SPEED_SHARES = (1.0, 0.5, 0.25)
"""Shares of the sideways speed that are tried, so that the turn keeps pace with the step."""


def step_to_pose(course: Course) -> Decided | None:
    """Leave rest by the first motion of a way planned with headings: a turn, or a turning step.

    For an elongated body that can move sideways, and fits at the heading of its path neither there
    nor a step on: it has to move off its heading, and to turn meanwhile.
    """
    input, state, start = course.input, course.state, course.start
    if not (course.is_blocked_at_rest and course.headed):
        return None
    seed = plan_seed(input.seed, "guide", input.sequence)
    space, goal, planner = input.optimistic, input.goal, input.planner
    found = plan(space, start.position, goal, planner, seed, start.heading)
    if found.waypoints is None or found.headings is None:
        return None
    trajectory = _first_motion(input, start, found.waypoints, found.headings)
    if trajectory is None:
        return None
    return Decided(_stepping(trajectory), replace(state, route=None))


def is_stepping(state: PlannerState, start: TrajectorySample) -> bool:
    """Return whether a body is on its way to such a pose."""
    return not start.at_rest and state.route is None and state.under_way == "step"


def continue_step(situation: Situation) -> Decided | None:
    """Go on with a step that is under way, if the body fits along the rest of it."""
    input, state = situation.input, situation.state
    if not is_stepping(state, situation.start):
        return None
    elapsed = (input.effect_ns - state.trajectory.start_ns) * 1e-9
    if first_misfit(input.traversable, state.trajectory, elapsed) is not None:
        return None
    return Decided(_stepping(state.trajectory), state)


def _stepping(trajectory: Trajectory) -> Command:
    """Return the command to take a step."""
    reason = Reason("following", free_m=arc_length(trajectory.path))
    return Command("follow", reason, label="none", trajectory=trajectory, under_way="step")


def _first_motion(
    input: PlannerInput, start: TrajectorySample, waypoints: Array, headings: Array
) -> Trajectory | None:
    """Return the turn or step to the first pose that differs; None if the body does not fit."""
    step = _first_step(start, waypoints, headings)
    turning = turn_in_place(
        start.position, input.effect_ns, start.heading, step.heading, input.gait.limits
    )
    if distance(start.position, step.position) <= STANDS:
        motions = [turning]
    else:
        path = np.stack([start.position, step.position])
        sideways = input.gait.sideways_speed / input.gait.limits.speed
        motions = [
            dataclasses.replace(
                plan_trajectory(input, start, path, share * sideways), turning=turning.turning
            )
            for share in SPEED_SHARES
        ]
    for motion in motions:
        fits = first_misfit(input.traversable, motion) is None
        if fits and motion.duration_s > 0.0:
            return motion
    return None


class _Step(NamedTuple):
    """The pose that a motion ends at: (3,) m, and rad."""

    position: Array
    heading: float


def _first_step(start: TrajectorySample, waypoints: Array, headings: Array) -> _Step:
    """Return the first pose that is not the start, or one a longest step towards it."""
    for position, heading in zip(waypoints, headings.tolist(), strict=True):
        away = distance(start.position, position)
        if away > STANDS:
            share = min(1.0, LONGEST_STEP / away)
            turn = wrap_angle(heading - start.heading)
            reached = start.position + share * (position - start.position)
            return _Step(reached, start.heading + share * turn)
        if abs(wrap_angle(heading - start.heading)) > LEAST_TURN:
            return _Step(start.position, heading)
    return _Step(start.position, start.heading)
