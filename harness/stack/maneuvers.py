"""Manoeuvres that end where the robot is: hold, arrive, wait, brake.

All take the planner input, the planner state before the decision, and the start of the new
trajectory: the commanded state of the robot at the time of effect.
"""

from __future__ import annotations

from dataclasses import replace

from wayproof.harness.decision import Action, Label
from wayproof.harness.stack import obstruction
from wayproof.harness.stack.diagnosis import diagnose_lost_path, diagnose_no_path, obstructed
from wayproof.harness.stack.evasive_stop import clearest_stop
from wayproof.harness.stack.footprint_checks import first_misfit, moves_tail_first
from wayproof.harness.stack.global_path import HEADINGS, GlobalPlan
from wayproof.harness.stack.path_timing import at_begin
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.types import (
    Array,
    Command,
    Decided,
    PlannerInput,
    PlannerState,
    arc_length,
    distance,
    is_stationary,
)
from wayproof.planners import (
    Trajectory,
    TrajectorySample,
    hold,
    remaining,
    stop_along,
)


def hold_position(input: PlannerInput, state: PlannerState, setpoint: TrajectorySample) -> Decided:
    """Hold the estimated pose: the robot is too far from its setpoint."""
    trajectory = hold(input.position, input.effect_ns, input.heading)
    reason = Reason(
        "localization_lost",
        distance_m=distance(input.position, setpoint.position),
        limit_m=input.behaviour.tracking_tolerance,
    )
    command = Command("recover", reason, "localization_lost", trajectory)
    return Decided(command, replace(state, trajectory=trajectory, global_path=None))


def arrive(input: PlannerInput, state: PlannerState, start: TrajectorySample) -> Decided:
    """Stand at the goal, and claim it."""
    trajectory = hold(start.position, input.effect_ns, start.heading)
    left = distance(input.position, input.goal)
    reason = Reason("arrived", distance_m=left, limit_m=input.goal_tolerance)
    command = Command("goal", reason, "none", trajectory)
    return Decided(command, replace(state, trajectory=trajectory))


def wait_at_blocked_goal(
    input: PlannerInput, state: PlannerState, start: TrajectorySample
) -> Decided:
    """Wait beside a goal inside the inflation for it to become free, then abort."""
    trajectory = hold(start.position, input.effect_ns, start.heading)
    state = _begin_to_wait(input, state)
    waited = seconds_waited(input, state)
    found = obstruction.at_place(input, input.goal, float(HEADINGS[0]), unknown_blocks=False)
    reason = obstructed("goal_blocked", found, waited_s=waited)
    action: Action = "abort" if waited >= input.behaviour.goal_wait_timeout else "stop_and_wait"
    command = Command(action, reason, "goal_blocked", trajectory)
    return Decided(command, replace(state, trajectory=trajectory, global_path=None))


def wait(
    input: PlannerInput,
    state: PlannerState,
    start: TrajectorySample,
    label: Label,
    reason: Reason,
) -> Decided:
    """Stay at rest until the map changes; the reason gets the time waited."""
    trajectory = hold(start.position, input.effect_ns, start.heading)
    state = replace(_begin_to_wait(input, state), trajectory=trajectory)
    reason = replace(reason, waited_s=seconds_waited(input, state))
    return Decided(Command("stop_and_wait", reason, label, trajectory, state.global_path), state)


def seconds_waited(input: PlannerInput, state: PlannerState) -> float:
    """Time for which the robot has waited at rest, s."""
    return (input.time_ns - state.rest_since_ns) * 1e-9


def _begin_to_wait(input: PlannerInput, state: PlannerState) -> PlannerState:
    return replace(state, rest_since_ns=input.time_ns) if state.rest_since_ns < 0 else state


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
    stop = stop_along(path, at_begin(input, start), input.limits, tail_first)
    trajectory = _without_turn(input, start, stop)
    if reason.kind == "braking_for_goal":
        reason = replace(reason, path_m=arc_length(trajectory.path))
    command = Command("stop_and_wait", reason, label, trajectory)
    return Decided(
        command, replace(state, trajectory=trajectory, global_path=None, exploration=None)
    )


def _without_turn(input: PlannerInput, start: TrajectorySample, stop: Trajectory) -> Trajectory:
    """Return a stop at the heading that the body has, if it fits so, and not as it turns."""
    if first_misfit(input.traversable, stop) is None:
        return stop
    still = stop.facing(start.heading)
    return still if first_misfit(input.traversable, still) is None else stop


def stop_without_path(
    input: PlannerInput, planned: GlobalPlan, start: TrajectorySample, previous: PlannerState
) -> Decided:
    """Brake along the last trajectory; at rest, wait for the map to change.

    Args:
        input: Planner input of the decision.
        planned: The planner state without a global path, and the search that found none.
        start: Start of the new trajectory.
        previous: Planner state before the decision, whose global path was dropped.
    """
    state, search = planned.state, planned.search
    if search is not None and is_stationary(start):
        return wait(input, state, start, search.label, reason=diagnose_no_path(input, search))
    path = remaining(state.trajectory.path, start.arc_length)
    if search is not None:
        return brake(input, state, start, path, diagnose_no_path(input, search), search.label)
    reason, label = diagnose_lost_path(input, previous, start)
    return brake(input, state, start, path, reason, label)
