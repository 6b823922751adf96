"""Following the global path: commit to its traversable part, turn into it, brake where it ends."""

from __future__ import annotations

from wayproof.harness.behaviour_config import MIN_ADVANCE
from wayproof.harness.geometry import wrap_angle
from wayproof.harness.stack import obstruction
from wayproof.harness.stack.course_keeping import keep_admitted_trajectory, keep_course
from wayproof.harness.stack.diagnosis import braking_reason, label_ahead, obstructed
from wayproof.harness.stack.driving import DrivablePart, drivable_part, drive_along
from wayproof.harness.stack.footprint_checks import moves_tail_first
from wayproof.harness.stack.global_path import heading_at
from wayproof.harness.stack.maneuvers import brake, wait
from wayproof.harness.stack.pose_step import step_to_pose
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.setting_out import (
    set_out,
    step_aside,
    turn_into_path,
    turn_while_driving,
)
from wayproof.harness.stack.types import (
    Decided,
    PlannerInput,
    PlannerState,
    arc_length,
    is_stationary,
)
from wayproof.planners import TrajectorySample, truncate


def follow_global_path(
    input: PlannerInput, state: PlannerState, start: TrajectorySample, previous: PlannerState
) -> Decided:
    """Commit to the traversable part of the global path, ending at rest.

    Args:
        input: Planner input of the decision.
        state: Planner state with the global path from `start` on.
        start: Start of the new trajectory.
        previous: Planner state before the decision, with the last global path.
    """
    path = state.path
    part = drivable_part(input, path, start)
    if part.too_short:
        kept = keep_admitted_trajectory(input, state, start, previous)
        return kept or brake_on_path(input, state, start, part)
    if is_stationary(start) and part.blocked and part.length < MIN_ADVANCE:
        stepped = step_aside(input, state, start) or step_to_pose(input, state, start)
        return stepped or wait_on_path(input, state, start, part)
    if is_stationary(start) and input.traversable.discs:
        return set_out(input, state, start, part)
    if is_stationary(start) and input.turns_in_place and not input.sideways_speed:
        target = heading_at(path, min(0.2, 0.5 * arc_length(path)))
        if abs(wrap_angle(target - start.heading)) > input.behaviour.rotate_in_place_angle:
            return turn_into_path(input, state, start, target)
    tail_first = moves_tail_first(input, start, path)
    if tail_first and input.sideways_speed:
        turning = turn_while_driving(input, state, start, part, tail_first=False)
        if turning is not None:
            return turning
    driven = drive_along(input, state, start, part, tail_first)
    return driven or keep_course(input, state, start, previous)


def brake_on_path(
    input: PlannerInput, state: PlannerState, start: TrajectorySample, part: DrivablePart
) -> Decided:
    """Brake: less of the global path can be driven than the robot needs to stop."""
    path, end = state.path, part.length
    kept = truncate(path, max(end, 1e-3))
    if not part.blocked:
        reason = Reason("braking_for_goal")
        return brake(input, state, start, path=kept, reason=reason, label="none")
    found = obstruction.on_path(input, path, end, input.unknown_blocks)
    reason, label = braking_reason(found)
    return brake(input, state, start, path=kept, reason=reason, label=label)


def wait_on_path(
    input: PlannerInput, state: PlannerState, start: TrajectorySample, part: DrivablePart
) -> Decided:
    """Wait at rest: something blocks the global path before an advance that is worth it."""
    found = obstruction.on_path(input, state.path, part.length, input.unknown_blocks)
    return wait(input, state, start, label_ahead(found), obstructed("waiting", found))
