"""Manoeuvres of an uncertain pose: hold where it is, go back to where it was held, give up.

For estimators that state a covariance. What such an estimator does not see in its sweeps it states
as unheld directions, and its standard deviation then grows with the way. Before the stack guesses
where it is, it goes back to where the sweeps last held the pose, and says `localization_lost`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wayproof.harness.behaviour_config import MIN_ADVANCE
from wayproof.harness.stack.global_path import ARRIVED
from wayproof.harness.stack.manoeuvres.following import follow
from wayproof.harness.stack.manoeuvres.stopping import brake
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.situation import Situation
from wayproof.harness.stack.state import Exploration, PlannerState, Route
from wayproof.harness.stack.types import (
    LENGTH_ROUNDING,
    Command,
    Decided,
    PlannerInput,
    arc_length,
    distance,
    is_free_along,
    is_stationary,
)
from wayproof.planners import hold, remaining

TRAIL_SPACING = 0.25
"""Distance between the points of the trail that leads back, m."""


def record_unheld_trail(state: PlannerState, input: PlannerInput) -> PlannerState:
    """Return the state with the trail (n, 3) from the last position that the sweeps held, m."""
    pose = input.localization
    if pose is None:
        return state
    if pose.held:
        return replace(state, trails=replace(state.trails, unheld=input.position[None]))
    trail = state.trails.unheld
    if state.returning or (len(trail) and distance(trail[-1], input.position) < TRAIL_SPACING):
        return state
    trail = np.vstack([trail, input.position])
    return replace(state, trails=replace(state.trails, unheld=trail))


def forget_way_back(state: PlannerState, input: PlannerInput) -> PlannerState:
    """Return the state without a way back to where the pose was held, once it is held again."""
    if not state.returning or _is_lost(input):
        return state
    return replace(state, route=None)


def hold_position(situation: Situation) -> Decided | None:
    """Hold the estimated pose: the robot is too far from its setpoint.

    By a pose that is old the setpoint has gone on, and the robot with it: it brakes on its way, and
    is at rest within its own stopping distance of the limit.
    """
    input, start = situation.input, situation.start
    limit = input.behaviour.tracking_tolerance
    away = distance(input.position, situation.setpoint.position)
    if away <= limit:
        return None
    reason = Reason("localization_lost", distance_m=away, limit_m=limit)
    is_old = input.pose_age_s > 0.0
    if is_old and not is_stationary(start):
        path = remaining(situation.state.trajectory.path, start.arc_length)
        return brake(input, situation.state, start, path, reason, label="localization_lost")
    trajectory = hold(input.position, input.effect_ns, input.heading)
    if is_old:
        trajectory = hold(start.position, input.effect_ns, start.heading)
    command = Command("recover", reason, "localization_lost", trajectory)
    return Decided(command, replace(situation.state, route=None))


def go_back_to_held(situation: Situation) -> Decided | None:
    """Brake, go back along the trail to where the sweeps held the pose, or else give up.

    Where the position's standard deviation exceeds `behaviour.lost_sigma`.
    """
    input, state, start = situation.input, situation.state, situation.start
    if not _is_lost(input):
        return None
    if state.returning:
        path = remaining(state.path, start.arc_length)
        arrived = arc_length(path) - LENGTH_ROUNDING <= ARRIVED
        if is_free_along(input.traversable, path) and not arrived:
            return follow(input, state.along(path), start, previous=state)
    if not is_stationary(start):
        path = remaining(state.trajectory.path, start.arc_length)
        reason = _lost(input, input.behaviour.lost_sigma)
        return brake(input, state, start, path, reason, label="localization_lost")
    path = np.vstack([start.position, state.trails.unheld[::-1]])
    path = path[np.append(True, np.abs(np.diff(path, axis=0)).max(axis=1) > 1e-6)]
    free = input.traversable.free_length(path) if len(path) > 1 else 0.0
    done = state.tries.returns >= input.behaviour.max_returns
    if done or free < max(arc_length(path) - LENGTH_ROUNDING, MIN_ADVANCE):
        return give_up(situation, limit=input.behaviour.lost_sigma)
    back = Exploration(input.sequence, returning=True)
    tries = replace(state.tries, returns=state.tries.returns + 1)
    state = replace(state, route=Route(path, input.time_ns, back), tries=tries)
    return follow(input, state, start, previous=state)


def give_up(situation: Situation, limit: float) -> Decided:
    """Give up at rest: the position's standard deviation exceeds a limit, m."""
    input, start = situation.input, situation.start
    trajectory = hold(start.position, input.effect_ns, start.heading)
    command = Command("abort", _lost(input, limit), "localization_lost", trajectory)
    return Decided(command, replace(situation.state, route=None))


def _is_lost(input: PlannerInput) -> bool:
    pose = input.localization
    return pose is not None and pose.sigma > input.behaviour.lost_sigma


def _lost(input: PlannerInput, limit: float) -> Reason:
    assert input.localization is not None
    return Reason("localization_lost", sigma_m=input.localization.sigma, limit_m=limit)
