"""Diagnosis of a command: the reason that it has, with the figures that make it true."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from wayproof.harness.decision import Action, Label
from wayproof.harness.geometry import wrap_angle
from wayproof.harness.stack import obstruction
from wayproof.harness.stack.footprint_checks import poses_from
from wayproof.harness.stack.global_path import ARRIVED
from wayproof.harness.stack.obstruction import Obstruction
from wayproof.harness.stack.reasons import Kind, Reason
from wayproof.harness.stack.state import PlannerState
from wayproof.harness.stack.types import (
    LENGTH_ROUNDING,
    Array,
    PlannerInput,
    arc_length,
    is_stationary,
)
from wayproof.planners import (
    Plan,
    Trajectory,
    TrajectorySample,
    remaining,
    stopping_distance,
    truncate,
)

BRAKING_SLACK = 0.01
"""Path left beyond the stopping distance, below which the robot counts as braking, m."""

HERE: tuple[Kind, ...] = ("goal_blocked", "leaving_inflation")
"""Kinds whose obstruction is where the body, or its goal, is, and not on a way."""


def obstructed(kind: Kind, found: Obstruction, **figures: Any) -> Reason:
    """Return a reason with its obstruction; of what is ahead, with the free length before it."""
    if kind not in HERE:
        figures["free_m"] = found.free_m
    return Reason(kind, cell=found.cell, cell_state=found.cell_state, place=found.place, **figures)


def label_ahead(found: Obstruction) -> Label:
    """Return the label of what is ahead: unknown, or blocked."""
    return "unknown_ahead" if found.cell_state == "unknown" else "path_blocked"


def braking_reason(found: Obstruction) -> tuple[Reason, Label]:
    """Return the reason and label of a robot that brakes for what is ahead."""
    unknown = found.cell_state == "unknown"
    kind: Kind = "braking_for_unknown" if unknown else "braking_for_blocked"
    return obstructed(kind, found), label_ahead(found)


def diagnose_driving(
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


def diagnose_no_path(input: PlannerInput, search: Plan) -> Reason:
    """Return the reason of a robot for which no path to the goal was found."""
    if search.label == "goal_blocked":
        found = obstruction.at_place(input, input.goal, 0.0, unknown_blocks=False)
        return obstructed("goal_blocked", found)
    return Reason("no_path", iterations=search.iterations)


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
    if previous.exploring and arc_length(path) < ARRIVED:  # at its viewpoint
        return Reason("waiting", since=input.sequence), "none"
    stop = stopping_distance(start.speed, start.acceleration, input.gait.limits)
    free = input.traversable.free_length(path)
    bendable = min(stop, arc_length(path) - LENGTH_ROUNDING)
    if free < bendable:  # no stretch of it is left that could be bent
        return braking_reason(obstruction.on_path(input, path, free, input.unknown_blocks))
    return Reason("braking_for_goal"), "none"  # which has another place now


def _diagnose_earlier_loss(input: PlannerInput, previous: PlannerState) -> tuple[Reason, Label]:
    """Return the reason and label where an earlier decision dropped the path."""
    loss = previous.path_loss
    if loss is None:  # a robot in motion without a path has had none from the start
        return Reason("waiting", since=input.sequence), "none"
    return Reason("waiting", since=loss.sequence), loss.label


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
        return obstructed("waiting", found)
    found = obstruction.on_poses(input, poses_from(along, 0.0), input.unknown_blocks)
    return obstructed("waiting", found)
