"""The decision: which manoeuvre the robot makes, and in which order they are considered.

The robot follows a *global path*: a path to the goal through space not known to be blocked. It
commits only to the part that the unknown policy lets it traverse, by a trajectory that ends at
rest. Each manoeuvre is a pure function of planner input, planner state and the start of the new
trajectory.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from wayproof.harness.stack.backtrack import record_breadcrumb
from wayproof.harness.stack.footprint_checks import compensate_yaw_lag, footprint_free
from wayproof.harness.stack.global_path import ARRIVED, keep_or_replan, project_goal_to_free
from wayproof.harness.stack.horizon import goal_within
from wayproof.harness.stack.localization import (
    at_path_end,
    cannot_claim_goal,
    give_up_at_goal,
    go_back_to_held,
    is_lost,
    record_unheld_trail,
)
from wayproof.harness.stack.maneuvers import (
    arrive,
    hold_position,
    stop_without_path,
    wait_at_blocked_goal,
)
from wayproof.harness.stack.path_following import follow_global_path
from wayproof.harness.stack.pose_step import continue_step, is_stepping
from wayproof.harness.stack.recovery import (
    continue_escape,
    escape_inflation,
    is_escaping,
    recover_after_timeout,
)
from wayproof.harness.stack.types import (
    Array,
    Decided,
    PathLoss,
    PlannerInput,
    PlannerState,
    distance,
    is_stationary,
)
from wayproof.planners import Trajectory, TrajectorySample


class PlanningGoal(NamedTuple):
    """The goal that the global path leads to.

    Attributes:
        position: (3,) m.
        projected: Whether the mission's goal lies inside the inflation, and this beside it.
    """

    position: Array
    projected: bool


def decide(input: PlannerInput, state: PlannerState) -> Decided:
    """Choose the next command; the same input and state always give the same result.

    Args:
        input: Planner input of this decision.
        state: Planner state that the last decision left; not written to.

    Returns:
        The command, and the state for the next decision.
    """
    committed = not_yet_superseded(input, state)
    state = record_unheld_trail(record_breadcrumb(state, input), input)
    command, after = _choose_maneuver(input, state, followed=committed[0])
    path_loss = None
    if after.global_path is None:
        path_loss = PathLoss(input.sequence, command.under_way, command.label)
        if state.path_loss is not None and command.reason.since == state.path_loss.sequence:
            path_loss = state.path_loss
    return Decided(command, replace(after, earlier=committed, path_loss=path_loss))


def not_yet_superseded(input: PlannerInput, state: PlannerState) -> tuple[Trajectory, ...]:
    """Return the committed trajectories from the one followed at the time of the sweep on."""
    committed = (*state.earlier, state.trajectory)
    begun = [k for k, trajectory in enumerate(committed) if trajectory.start_ns <= input.time_ns]
    return committed[begun[-1] if begun else 0 :]


def _choose_maneuver(input: PlannerInput, state: PlannerState, followed: Trajectory) -> Decided:
    """Take the first manoeuvre that applies.

    Args:
        input: Planner input of this decision.
        state: Planner state before the decision.
        followed: The trajectory that the robot follows at the time of the sweep.
    """
    setpoint = followed.at(input.time_ns)
    if distance(input.position, setpoint.position) > input.behaviour.tracking_tolerance:
        return hold_position(input, state, setpoint)
    start = compensate_yaw_lag(input, setpoint, state.trajectory.at(input.effect_ns))
    if setpoint.at_rest and distance(input.position, input.goal) <= input.goal_tolerance:
        if cannot_claim_goal(input):
            return give_up_at_goal(input, state, start)
        return arrive(input, state, start)
    if is_lost(input):
        return go_back_to_held(input, state, start)
    if state.returning:  # the pose is held again
        state = replace(state, global_path=None, exploration=None)
    if is_stationary(start) and not footprint_free(input.traversable, start):
        return recover_after_timeout(input, start, escape_inflation(input, state, start))
    if is_escaping(input, state, start):
        escaping = continue_escape(input, state, start)
        if escaping is not None:
            return escaping
    if is_stepping(state, start):
        stepping = continue_step(input, state, start)
        if stepping is not None:
            return stepping
    goal = _planning_goal(input, state, start)
    beside_goal = goal.projected and distance(start.position, goal.position) < ARRIVED
    if setpoint.at_rest and (beside_goal or at_path_end(state, start)) and cannot_claim_goal(input):
        return give_up_at_goal(input, state, start)
    if setpoint.at_rest and beside_goal:
        return wait_at_blocked_goal(input, state, start)
    input = replace(input, goal=goal.position, mission_goal=input.goal)
    return _head_for_goal(input, state, start)


def _planning_goal(
    input: PlannerInput, state: PlannerState, start: TrajectorySample
) -> PlanningGoal:
    """Return the mission's goal, its projection to free space, or an intermediate one."""
    goal = goal_within(input, state, start)
    if goal is not input.goal:  # an intermediate one, which is projected already
        return PlanningGoal(goal, projected=False)
    free = project_goal_to_free(input)
    return PlanningGoal(free, projected=free is not goal)


def _head_for_goal(input: PlannerInput, state: PlannerState, start: TrajectorySample) -> Decided:
    """Follow the global path to the goal, or stop without one; after a long wait, recover."""
    planned = keep_or_replan(input, state, start)
    if planned.state.global_path is None:
        decided = stop_without_path(input, planned, start, previous=state)
    else:
        decided = follow_global_path(input, planned.state, start, previous=state)
    command, after = recover_after_timeout(input, start, decided)
    if command.search is None:  # a search for a frontier is the one that was acted on
        command = replace(command, search=planned.search, search_seed=planned.seed)
    return Decided(command, after)
