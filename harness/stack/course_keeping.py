"""Keeping the course of an elongated body in motion that does not fit along the new path."""

from __future__ import annotations

from dataclasses import replace

from wayproof.harness.stack import obstruction
from wayproof.harness.stack.diagnosis import braking_reason
from wayproof.harness.stack.driving import drivable_part, drive_along
from wayproof.harness.stack.footprint_checks import first_misfit, moves_tail_first, poses_from
from wayproof.harness.stack.maneuvers import brake
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.types import (
    Command,
    Decided,
    PlannerInput,
    PlannerState,
    arc_length,
    is_stationary,
)
from wayproof.planners import Trajectory, TrajectorySample, remaining


def keep_admitted_trajectory(
    input: PlannerInput, state: PlannerState, start: TrajectorySample, previous: PlannerState
) -> Decided | None:
    """Keep the last trajectory of an elongated body in motion that need not brake for the path.

    As where it steps aside, at a heading that is not that of its path.

    Returns:
        None if the footprint does not fit along the trajectory to its rest.
    """
    moves = input.traversable.discs and not is_stationary(start)
    return _kept(state, previous) if moves and _fits(input, previous.trajectory) else None


def keep_course(
    input: PlannerInput, state: PlannerState, start: TrajectorySample, previous: PlannerState
) -> Decided:
    """Keep the last trajectory if the footprint fits along it, else stop on it.

    For an elongated body in motion that does not fit along the new path.
    """
    trajectory = previous.trajectory
    if _fits(input, trajectory):
        return _kept(state, previous)
    driven = _drive_last_path(input, state, start, previous)
    if driven is not None:
        return driven
    elapsed = (input.effect_ns - trajectory.start_ns) * 1e-9
    found = obstruction.on_poses(input, poses_from(trajectory, elapsed), input.unknown_blocks)
    path = remaining(trajectory.path, start.arc_length)
    reason, label = braking_reason(found)
    return brake(input, state, start, path, reason, label)


def _fits(input: PlannerInput, trajectory: Trajectory) -> bool:
    """Return whether the footprint fits along the rest of a trajectory."""
    elapsed = (input.effect_ns - trajectory.start_ns) * 1e-9
    return first_misfit(input.traversable, trajectory, elapsed) is None


def _kept(state: PlannerState, previous: PlannerState) -> Decided:
    """Return the decision to follow the last trajectory."""
    command = Command(
        "follow",
        Reason("following", free_m=arc_length(previous.trajectory.path)),
        label="none",
        trajectory=previous.trajectory,
        global_path=previous.global_path,
    )
    return Decided(command, replace(previous, improved_ns=state.improved_ns))


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
