"""Reactions to an uncertain pose: drive slower, go back, or give up.

For estimators that state a covariance. What such an estimator does not see in its sweeps it states
as unheld directions, and its standard deviation then grows with the way. Before the stack guesses
where it is, it goes back to where the sweeps last held the pose, and says `localization_lost`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wayproof.harness.behaviour_config import MIN_ADVANCE
from wayproof.harness.stack.global_path import ARRIVED
from wayproof.harness.stack.maneuvers import brake
from wayproof.harness.stack.mapping import MARGIN_SIGMAS
from wayproof.harness.stack.path_following import follow_global_path
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.types import (
    LENGTH_ROUNDING,
    Command,
    Decided,
    Exploration,
    PlannerInput,
    PlannerState,
    arc_length,
    distance,
    is_free_along,
    is_stationary,
)
from wayproof.planners import TrajectorySample, hold, remaining

TRAIL_SPACING = 0.25
"""Distance between the points of the trail that leads back, m."""


def record_unheld_trail(state: PlannerState, input: PlannerInput) -> PlannerState:
    """Return the state with the trail (n, 3) from the last position that the sweeps held, m."""
    pose = input.localization
    if pose is None:
        return state
    if pose.held:
        return replace(state, unheld_trail=input.position[None])
    trail = state.unheld_trail
    if state.returning or (len(trail) and distance(trail[-1], input.position) < TRAIL_SPACING):
        return state
    return replace(state, unheld_trail=np.vstack([trail, input.position]))


def is_lost(input: PlannerInput) -> bool:
    """Return whether the position's standard deviation exceeds `behaviour.lost_sigma`."""
    pose = input.localization
    return pose is not None and pose.sigma > input.behaviour.lost_sigma


def cannot_claim_goal(input: PlannerInput) -> bool:
    """Return whether two standard deviations of the position are more than the goal's tolerance."""
    pose = input.localization
    return pose is not None and MARGIN_SIGMAS * pose.sigma > input.goal_tolerance


def at_path_end(state: PlannerState, start: TrajectorySample) -> bool:
    """Return whether the robot stands at the end of its global path."""
    if state.global_path is None or state.exploring:
        return False
    return arc_length(remaining(state.global_path, start.arc_length)) < ARRIVED


def give_up_at_goal(input: PlannerInput, state: PlannerState, start: TrajectorySample) -> Decided:
    """Give up beside a goal that the pose is too uncertain to claim."""
    return _stand(input, state, start, limit=input.goal_tolerance / MARGIN_SIGMAS)


def go_back_to_held(input: PlannerInput, state: PlannerState, start: TrajectorySample) -> Decided:
    """Brake, go back along the trail to where the sweeps held the pose, or else give up.

    Args:
        input: Planner input of the decision.
        state: Planner state before the decision.
        start: Start of the new trajectory.
    """
    if state.returning:
        path = remaining(state.path, start.arc_length)
        arrived = arc_length(path) - LENGTH_ROUNDING <= ARRIVED
        if is_free_along(input.traversable, path) and not arrived:
            return follow_global_path(
                input, replace(state, global_path=path), start, previous=state
            )
    if not is_stationary(start):
        path = remaining(state.trajectory.path, start.arc_length)
        reason = _lost(input, input.behaviour.lost_sigma)
        return brake(input, state, start, path, reason, label="localization_lost")
    path = np.vstack([start.position, state.unheld_trail[::-1]])
    path = path[np.append(True, np.abs(np.diff(path, axis=0)).max(axis=1) > 1e-6)]
    free = input.traversable.free_length(path) if len(path) > 1 else 0.0
    done = state.returns >= input.behaviour.max_returns
    if done or free < max(arc_length(path) - LENGTH_ROUNDING, MIN_ADVANCE):
        return _stand(input, state, start, limit=input.behaviour.lost_sigma)
    state = replace(
        state,
        global_path=path,
        exploration=Exploration(input.sequence, returning=True),
        improved_ns=input.time_ns,
        returns=state.returns + 1,
    )
    return follow_global_path(input, state, start, previous=state)


def _stand(
    input: PlannerInput, state: PlannerState, start: TrajectorySample, limit: float
) -> Decided:
    """Give up at rest: the position's standard deviation exceeds a limit, m."""
    trajectory = hold(start.position, input.effect_ns, start.heading)
    reason = _lost(input, limit)
    command = Command("abort", reason, "localization_lost", trajectory)
    state = replace(state, trajectory=trajectory, global_path=None, exploration=None)
    return Decided(command, state)


def _lost(input: PlannerInput, limit: float) -> Reason:
    assert input.localization is not None
    return Reason("localization_lost", sigma_m=input.localization.sigma, limit_m=limit)
