"""Diagnosis of a command: the reason that it has, with the figures that make it true."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

from wayproof.harness.decision import Action, Label
from wayproof.harness.geometry import wrap_angle
from wayproof.harness.stack import obstruction
from wayproof.harness.stack.footprint_checks import poses_from
from wayproof.harness.stack.global_path import ARRIVED
from wayproof.harness.stack.obstruction import Obstruction
from wayproof.harness.stack.reasons import Kind, Reason
from wayproof.harness.stack.types import (
    LENGTH_ROUNDING,
    Array,
    PlannerInput,
    PlannerState,
    arc_length,
    distance,
    is_stationary,
)
from wayproof.planners import (
    Plan,
    Trajectory,
    TrajectorySample,
    planner_traits,
    remaining,
    stopping_distance,
    truncate,
)

BRAKING_SLACK = 0.01
"""Path left beyond the stopping distance, below which the robot counts as braking, m."""

AT_GOAL = 0.01
"""Distance from the goal within which a path counts as ending there, m."""


class Kinds(NamedTuple):
    """Kinds of reason by the end of the way ahead: unknown space, or a blocked cell."""

    unknown: Kind
    blocked: Kind


DRIVING = Kinds("unknown_ahead", "blocked_ahead")
BRAKES = Kinds("braking_before_unknown", "braking_before_blocked")
WAITS = Kinds("waiting_before_unknown", "waiting_before_blocked")


def way_ahead_reason(kinds: Kinds, found: Obstruction, **figures: Any) -> tuple[Reason, Label]:
    """Return the reason and label that name what is unknown or blocked on the way ahead."""
    if found.cell_state == "unknown":
        return _reason(kinds.unknown, found, free_m=found.free_m, **figures), "unknown_ahead"
    return _reason(kinds.blocked, found, free_m=found.free_m, **figures), "path_blocked"


def inflation_reason(kind: Kind, found: Obstruction, **figures: Any) -> Reason:
    """Return the reason of a body, or of a goal, inside the inflation of a cell."""
    return _reason(kind, found, **figures)


def _reason(kind: Kind, found: Obstruction, **figures: Any) -> Reason:
    return Reason(kind, cell=found.cell, cell_state=found.cell_state, place=found.place, **figures)


def diagnose_driving(
    input: PlannerInput,
    state: PlannerState,
    start: TrajectorySample,
    end: float,
    *,
    blocked: bool,
    slowed: bool,
) -> tuple[Action, Reason, Label]:
    """Return the action, reason and label of a robot that drives its global path.

    Args:
        input: Planner input of the decision.
        state: Planner state with the global path.
        start: Start of the new trajectory.
        end: Arc length up to which the path is driven, m.
        blocked: Whether an obstruction ends it there.
        slowed: Whether unknown space on it costs speed.
    """
    path = state.path
    if slowed:
        driven = truncate(path, end)
        free = input.known_free.free_length(driven)
        found = obstruction.on_path(input, driven, free, unknown_blocks=True)
        share = input.behaviour.unknown_speed_fraction
        reason = _reason("through_unknown", found, free_m=found.free_m, speed_share=share)
        near = found.free_m < stopping_distance(input.limits.speed, 0.0, input.limits)
        action: Action = "slow" if near else "follow"
        label: Label = "unknown_ahead"
    elif blocked:
        found = obstruction.on_path(input, path, end, input.unknown_blocks)
        needed = stopping_distance(input.limits.speed, 0.0, input.limits)
        reason, label = way_ahead_reason(DRIVING, found, full_speed_stop_m=needed)
        action = "slow" if end < needed else "follow"
    else:
        action, reason, label = "follow", _unobstructed_reason(input, start, path, end), "none"
    if input.uncertain and input.localization is not None:
        action, reason = "slow", replace(reason, sigma_m=input.localization.sigma)
    if input.noisy:
        action, reason = "slow", replace(reason, range_sigma_m=input.range_sigma)
    if state.exploration is not None:
        action, reason = exploration_reason(state, path, input)
    return action, reason, "localization_lost" if state.returning else label


def _unobstructed_reason(
    input: PlannerInput, start: TrajectorySample, path: Array, end: float
) -> Reason:
    """Return the reason where all of a path is traversable, to its end or to a corner."""
    whole = arc_length(path)
    goal = input.goal if input.mission_goal is None else input.mission_goal
    beside = distance(path[-1], goal)
    short = beside if beside > AT_GOAL else None
    if end < whole:
        return Reason("path_to_corner", free_m=end, path_m=whole, short_m=short)
    stop = stopping_distance(start.speed, start.acceleration, input.limits)
    if not is_stationary(start) and whole - stop < BRAKING_SLACK:
        return Reason("braking_to_goal", path_m=whole, stop_m=stop, short_m=short)
    return Reason("path_to_goal", path_m=whole, short_m=short)


def exploration_reason(
    state: PlannerState, path: Array, input: PlannerInput
) -> tuple[Action, Reason]:
    """Return the action and reason of a robot on its way to a viewpoint, or back."""
    exploration = state.exploration
    assert exploration is not None
    x, y, z = path[-1].tolist()
    left, since, target = arc_length(path), exploration.since, (x, y, z)
    if exploration.returning and input.localization is not None:
        limit, sigma = input.behaviour.lost_sigma, input.localization.sigma
        return "recover", Reason(
            "returning_to_held",
            path_m=left,
            since=since,
            target=target,
            limit_m=limit,
            sigma_m=sigma,
        )
    if exploration.backtracking:
        return "recover", Reason("backing_up", path_m=left, since=since, target=target)
    places = len(state.viewpoints)
    reason = Reason("looking_elsewhere", path_m=left, since=since, target=target, places=places)
    return "explore", reason


def diagnose_no_path(input: PlannerInput, search: Plan) -> Reason:
    """Return the reason of a robot for which no path to the goal was found."""
    if search.label == "goal_blocked":
        found = obstruction.at_place(input, input.goal, 0.0, unknown_blocks=False)
        return inflation_reason("goal_blocked", found, limit_m=input.behaviour.goal_search_radius)
    exhaustive = planner_traits(input.planner.name).complete and not input.traversable.discs
    if exhaustive and search.label == "no_path" and search.iterations < input.planner.iterations:
        return Reason("no_path_in_map", iterations=search.iterations)
    return Reason("no_path_found", iterations=search.iterations)


def diagnose_lost_path(
    input: PlannerInput, previous: PlannerState, start: TrajectorySample
) -> tuple[Reason, Label]:
    """Return the reason and label of a robot in motion without a global path.

    Args:
        input: Planner input of the decision.
        previous: State before it; it has the path, unless an earlier decision dropped that.
        start: Start of the new trajectory.
    """
    if previous.global_path is None:
        return _diagnose_earlier_loss(input, previous)
    path = remaining(previous.global_path, start.arc_length)
    if previous.exploring and arc_length(path) < ARRIVED:
        return Reason("at_viewpoint", path_m=0.0), "none"
    stop = stopping_distance(start.speed, start.acceleration, input.limits)
    free = input.traversable.free_length(path)
    bendable = min(stop, arc_length(path) - LENGTH_ROUNDING)
    if free < bendable:  # no stretch of it is left that could be bent
        found = obstruction.on_path(input, path, free, input.unknown_blocks)
        return way_ahead_reason(BRAKES, found, stop_m=stop)
    x, y, z = input.goal.tolist()
    moved = distance(path[-1], input.goal)
    return Reason("goal_place_moved", distance_m=moved, stop_m=stop, target=(x, y, z)), "none"


def _diagnose_earlier_loss(input: PlannerInput, previous: PlannerState) -> tuple[Reason, Label]:
    """Return the reason and label where an earlier decision dropped the path."""
    loss = previous.path_loss
    if loss is None:  # a robot in motion without a path has had none from the start
        return Reason("coming_to_rest", path_m=0.0, since=input.sequence), "none"
    if loss.kind == "at_viewpoint":
        return Reason("at_viewpoint", path_m=0.0, since=loss.sequence), "none"
    return Reason("coming_to_rest", path_m=0.0, since=loss.sequence), loss.label


def diagnose_no_room(
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
        return _reason("no_room_to_turn", found, turn_rad=turn)
    found = obstruction.on_poses(input, poses_from(along, 0.0), input.unknown_blocks)
    return _reason("no_room_along_path", found, free_m=found.free_m)
