"""Coming to rest, and staying there: wait, brake, stop without a path."""

from __future__ import annotations

from dataclasses import replace

from wayproof.harness.decision import Label
from wayproof.harness.stack import obstruction
from wayproof.harness.stack.footprint_checks import first_misfit, moves_tail_first
from wayproof.harness.stack.global_path import ARRIVED, GlobalPlan
from wayproof.harness.stack.manoeuvres.evasive_stop import clearest_stop
from wayproof.harness.stack.obstruction import braking_reason, obstructed
from wayproof.harness.stack.path_timing import at_begin
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.situation import Situation
from wayproof.harness.stack.state import PlannerState
from wayproof.harness.stack.types import (
    LENGTH_ROUNDING,
    Array,
    Command,
    Decided,
    PlannerInput,
    arc_length,
    is_stationary,
)
from wayproof.planners import (
    Plan,
    Trajectory,
    TrajectorySample,
    hold,
    remaining,
    stop_along,
    stopping_distance,
)


def wait(
    input: PlannerInput,
    state: PlannerState,
    start: TrajectorySample,
    label: Label,
    reason: Reason,
) -> Decided:
    """Stay at rest until the map changes; the reason gets the time waited."""
    trajectory = hold(start.position, input.effect_ns, start.heading)
    since_ns = state.rest_since_ns if state.rest_since_ns >= 0 else input.time_ns
    state = replace(state, rest_since_ns=since_ns)
    reason = replace(reason, waited_s=seconds_waited(input, state))
    return Decided(Command("stop_and_wait", reason, label, trajectory, state.global_path), state)


def seconds_waited(input: PlannerInput, state: PlannerState) -> float:
    """Time for which the robot has waited at rest, s."""
    return (input.time_ns - state.rest_since_ns) * 1e-9


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
    stop = stop_along(path, at_begin(input, start), input.gait.limits, tail_first)
    trajectory = _without_turn(input, start, stop)
    if reason.kind == "braking_for_goal":
        reason = replace(reason, path_m=arc_length(trajectory.path))
    command = Command("stop_and_wait", reason, label, trajectory)
    return Decided(command, replace(state, route=None))


def _without_turn(input: PlannerInput, start: TrajectorySample, stop: Trajectory) -> Trajectory:
    """Return a stop at the heading that the body has, if it fits so, and not as it turns."""
    if first_misfit(input.traversable, stop) is None:
        return stop
    still = stop.facing(start.heading)
    return still if first_misfit(input.traversable, still) is None else stop


def stop_without_path(situation: Situation) -> Decided | None:
    """Brake along the last trajectory; at rest, wait for the map to change.

    Where there is no global path: it was lost, or a search found none.
    """
    planned, start = situation.planned, situation.start
    if planned.state.route is not None:
        return None
    input, state, search = situation.heading_for, planned.state, planned.search
    path = remaining(state.trajectory.path, start.arc_length)
    if search is None:
        reason, label = _lost_path(input, situation.state, start)
        return brake(input, state, start, path, reason, label)
    reason = _no_path(input, search)
    if is_stationary(start):
        decided = wait(input, state, start, search.label, reason)
    else:
        decided = brake(input, state, start, path, reason, search.label)
    return searched(decided, planned)


def searched(decided: Decided, planned: GlobalPlan) -> Decided:
    """Return a decision whose command names the search that it rests on, if one was made."""
    command = replace(decided.command, search=planned.search, search_seed=planned.seed)
    return decided._replace(command=command)


def _no_path(input: PlannerInput, search: Plan) -> Reason:
    """Return the reason of a robot for which no path to the goal was found."""
    if search.label == "goal_blocked":
        found = obstruction.at_place(input, input.goal, 0.0, unknown_blocks=False)
        return obstructed("goal_blocked", found)
    return Reason("no_path", iterations=search.iterations)


def _lost_path(
    input: PlannerInput, previous: PlannerState, start: TrajectorySample
) -> tuple[Reason, Label]:
    """Return the reason and label of a robot in motion without a global path.

    Args:
        input: Planner input of the decision.
        previous: State before it; it has the path, unless an earlier decision dropped that.
        start: Start of the new trajectory.
    """
    if previous.global_path is None:
        return _earlier_loss(input, previous)
    path = remaining(previous.global_path, start.arc_length)
    if previous.exploring and arc_length(path) < ARRIVED:  # at its viewpoint
        return Reason("waiting", since=input.sequence), "none"
    stop = stopping_distance(start.speed, start.acceleration, input.gait.limits)
    free = input.traversable.free_length(path)
    bendable = min(stop, arc_length(path) - LENGTH_ROUNDING)
    if free < bendable:  # no stretch of it is left that could be bent
        return braking_reason(obstruction.on_path(input, path, free, input.unknown_blocks))
    return Reason("braking_for_goal"), "none"  # which has another place now


def _earlier_loss(input: PlannerInput, previous: PlannerState) -> tuple[Reason, Label]:
    """Return the reason and label where an earlier decision dropped the path."""
    loss = previous.path_loss
    if loss is None:  # a robot in motion without a path has had none from the start
        return Reason("waiting", since=input.sequence), "none"
    return Reason("waiting", since=loss.sequence), loss.label
