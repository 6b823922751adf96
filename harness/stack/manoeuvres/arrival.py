"""Manoeuvres at the goal: claim it, give up what cannot be claimed, wait beside a blocked one."""

from __future__ import annotations

from dataclasses import replace

from wayproof.harness.stack import obstruction
from wayproof.harness.stack.global_path import HEADINGS
from wayproof.harness.stack.manoeuvres.lost_pose import give_up
from wayproof.harness.stack.manoeuvres.stopping import wait
from wayproof.harness.stack.mapping import MARGIN_SIGMAS
from wayproof.harness.stack.obstruction import obstructed
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.situation import Situation
from wayproof.harness.stack.types import Command, Decided, distance
from wayproof.planners import hold


def give_up_at_goal(situation: Situation) -> Decided | None:
    """Give up at the goal if the pose is too uncertain to claim it."""
    return _give_up(situation) if _is_at_goal(situation) and _is_unsure(situation) else None


def give_up_beside_goal(situation: Situation) -> Decided | None:
    """Give up as near to the goal as it gets, if the pose is too uncertain to claim it."""
    if not _is_unsure(situation):
        return None
    ends = situation.rests_at_path_end or situation.rests_beside_goal
    return _give_up(situation) if ends else None


def arrive(situation: Situation) -> Decided | None:
    """Stand at the goal, and claim it."""
    if not _is_at_goal(situation):
        return None
    input, start = situation.input, situation.start
    trajectory = hold(start.position, input.effect_ns, start.heading)
    left = distance(input.position, input.goal)
    reason = Reason("arrived", distance_m=left, limit_m=input.goal_tolerance)
    command = Command("goal", reason, "none", trajectory)
    return Decided(command, situation.state)


def wait_at_blocked_goal(situation: Situation) -> Decided | None:
    """Wait beside a goal inside the inflation for it to become free."""
    if not situation.rests_beside_goal:
        return None
    input = situation.input
    found = obstruction.at_place(input, input.goal, float(HEADINGS[0]), unknown_blocks=False)
    state = replace(situation.state, route=None)
    reason = obstructed("goal_blocked", found)
    return wait(input, state, situation.start, "goal_blocked", reason)


def _is_at_goal(situation: Situation) -> bool:
    input = situation.input
    near = distance(input.position, input.goal) <= input.goal_tolerance
    return situation.setpoint.at_rest and near


def _is_unsure(situation: Situation) -> bool:
    """Return whether two standard deviations of the position are more than the tolerance."""
    pose, tolerance = situation.input.localization, situation.input.goal_tolerance
    return pose is not None and MARGIN_SIGMAS * pose.sigma > tolerance


def _give_up(situation: Situation) -> Decided:
    return give_up(situation, limit=situation.input.goal_tolerance / MARGIN_SIGMAS)
