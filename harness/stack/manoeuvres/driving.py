"""Driving a part of the global path: how far, how fast, and where the footprint fits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from wayproof.harness.decision import Action, Label
from wayproof.harness.stack import obstruction
from wayproof.harness.stack.footprint_checks import (
    MIN_PATH,
    first_misfit,
    moves_tail_first,
    truncate_where_turnable,
)
from wayproof.harness.stack.obstruction import label_ahead, obstructed
from wayproof.harness.stack.path_timing import plan_trajectory
from wayproof.harness.stack.reasons import Kind, Reason
from wayproof.harness.stack.situation import Course
from wayproof.harness.stack.state import PlannerState
from wayproof.harness.stack.types import (
    Array,
    Command,
    Decided,
    PlannerInput,
    arc_length,
    is_stationary,
)
from wayproof.planners import (
    SlowEnd,
    Trajectory,
    TrajectorySample,
    stopping_distance,
    truncate,
)

BRAKING_SLACK = 0.01
"""Path left beyond the stopping distance, below which the robot counts as braking, m."""

MAX_SHORTENINGS = 8
"""Number of times that a path is shortened to make the footprint fit along it.

Each time it ends earlier, the body turns later on it, and may not fit there, either.
"""

MISFIT_MARGIN = 0.02
"""Distance kept before the first place where the footprint does not fit, m."""


def drive(course: Course) -> Decided | None:
    """Drive the part of the global path; None if the footprint does not fit, or too little of it.

    Tail first, if an elongated body in motion is on it so.
    """
    return drive_along(course, moves_tail_first(course.input, course.start, course.state.path))


def drive_along(course: Course, tail_first: bool) -> Decided | None:
    """Drive the part of the global path, nose or tail first; None as of `drive`."""
    input, state, start, _, part = course
    path = truncate(state.path, part.length)
    if tail_first:
        braking = stopping_distance(start.speed, start.acceleration, input.gait.limits)
        path = truncate_where_turnable(input.traversable, path, braking)
    slow_end = _unknown_end(input, path)
    doubtful = input.uncertain or input.noisy
    share = input.behaviour.uncertain_speed_fraction if doubtful else 1.0
    trajectory = fit_trajectory(input, start, path, share, tail_first, slow_end)
    if trajectory is None:
        return None
    action, reason, label = _diagnosis(
        input,
        state,
        start,
        trajectory,
        part.length,
        blocked=part.blocked,
        slowed=slow_end is not None,
    )
    command = Command(action, reason, label, trajectory, state.path)
    return Decided(command, state)


def _unknown_end(input: PlannerInput, path: Array) -> SlowEnd | None:
    """Return where unknown space begins to cost speed on a path (n, 3); None if it nowhere does."""
    if input.config.costmap.unknown_policy != "penalize":
        return None
    known = input.known_free.free_length(path)
    if known >= arc_length(path):
        return None
    return SlowEnd(known, input.behaviour.unknown_speed_fraction * input.gait.limits.speed)


def fit_trajectory(
    input: PlannerInput,
    start: TrajectorySample,
    path: Array,
    speed_share: float,
    tail_first: bool,
    slow_end: SlowEnd | None = None,
) -> Trajectory | None:
    """Plan a trajectory along a path, shortened to where the footprint fits at each heading.

    Args:
        input: Planner input of the decision.
        start: Start of the new trajectory.
        path: (n, 3), m.
        speed_share: Share of full speed.
        tail_first: Whether an elongated body moves backwards.
        slow_end: A further speed limit towards the end of the path.

    Returns:
        None if that leaves less than the robot needs to stop.
    """
    if tail_first:
        speed_share = min(speed_share, input.behaviour.reverse_speed_fraction)
    if input.traversable.discs:
        speed_share = min(speed_share, input.behaviour.narrow_speed_fraction)
    braking = stopping_distance(start.speed, start.acceleration, input.gait.limits)
    return shortened_to_fit(
        input,
        path,
        max(braking, MIN_PATH),
        lambda way: plan_trajectory(
            input,
            start,
            path=way,
            speed_share=speed_share,
            tail_first=tail_first,
            slow_end=slow_end,
        ),
    )


def shortened_to_fit(
    input: PlannerInput, path: Array, least: float, plan: Callable[[Array], Trajectory]
) -> Trajectory | None:
    """Plan along a path (n, 3), shortened until the footprint fits; None below `least`, m."""
    for _ in range(MAX_SHORTENINGS):
        trajectory = plan(path)
        misfit = first_misfit(input.traversable, trajectory)
        if misfit is None:
            return trajectory
        end = misfit - MISFIT_MARGIN
        if end < least:
            return None
        path = truncate(path, end)
    return None


def _diagnosis(
    input: PlannerInput,
    state: PlannerState,
    start: TrajectorySample,
    trajectory: Trajectory,
    end: float,
    blocked: bool,
    slowed: bool,
) -> tuple[Action, Reason, Label]:
    """Return the action, reason and label of a robot that drives part of its global path.

    Args:
        input: Planner input of the decision.
        state: Planner state with the global path.
        start: Start of the new trajectory.
        trajectory: That trajectory.
        end: Length of the part, m.
        blocked: Whether what is not traversable ends it there.
        slowed: Whether unknown space on it costs speed.
    """
    path, full_stop = state.path, stopping_distance(input.gait.limits.speed, 0.0, input.gait.limits)
    action: Action = "follow"
    label: Label = "none"
    if slowed:
        driven = truncate(path, end)
        free = input.known_free.free_length(driven)
        found = obstruction.on_path(input, driven, free, unknown_blocks=True)
        reason, label = obstructed("slowing_for_unknown", found), "unknown_ahead"
        action = "slow" if free < full_stop else "follow"
    elif blocked:
        found = obstruction.on_path(input, path, end, input.unknown_blocks)
        label, action = label_ahead(found), "slow" if end < full_stop else "follow"
        slowing: Kind = "slowing_for_unknown" if label == "unknown_ahead" else "braking_for_blocked"
        reason = obstructed(slowing if action == "slow" else "following", found)
    else:
        reason = _unobstructed_reason(input, start, trajectory, arc_length(path) - end)
    if input.uncertain and input.localization is not None:
        action, reason = "slow", replace(reason, sigma_m=input.localization.sigma)
    if input.noisy:
        action, reason = "slow", replace(reason, range_sigma_m=input.range_sigma)
    if state.exploration is not None:
        action, reason = exploration_reason(state, path, input)
    return action, reason, "localization_lost" if state.returning else label


def _unobstructed_reason(
    input: PlannerInput, start: TrajectorySample, trajectory: Trajectory, beyond: float
) -> Reason:
    """Return the reason where a path is traversable to its end, or to a corner before, m."""
    committed = arc_length(trajectory.path)
    stop = stopping_distance(start.speed, start.acceleration, input.gait.limits)
    if beyond <= 0.0 and not is_stationary(start) and committed - stop < BRAKING_SLACK:
        return Reason("braking_for_goal", path_m=committed)
    return Reason("following", free_m=committed)


def exploration_reason(
    state: PlannerState, path: Array, input: PlannerInput
) -> tuple[Action, Reason]:
    """Return the action and reason of a robot on its way to a viewpoint, or back."""
    exploration = state.exploration
    assert exploration is not None
    x, y, z = path[-1].tolist()
    since, target = exploration.since, (x, y, z)
    if exploration.returning and input.localization is not None:
        limit, sigma = input.behaviour.lost_sigma, input.localization.sigma
        return "recover", Reason(
            "going_back", since=since, target=target, limit_m=limit, sigma_m=sigma
        )
    if exploration.backtracking:
        return "recover", Reason("going_back", since=since, target=target)
    places = len(state.tries.viewpoints)
    return "explore", Reason("looking_elsewhere", since=since, target=target, places=places)
