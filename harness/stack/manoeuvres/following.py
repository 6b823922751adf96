"""Following the global path: commit to its traversable part, turn into it, brake where it ends."""

from __future__ import annotations

from wayproof.harness.stack import obstruction
from wayproof.harness.stack.course import Course, drivable_part
from wayproof.harness.stack.manoeuvres.stopping import brake, searched, wait
from wayproof.harness.stack.obstruction import braking_reason, label_ahead, obstructed
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.situation import Situation, first_that_applies
from wayproof.harness.stack.state import PlannerState
from wayproof.harness.stack.types import Decided, PlannerInput
from wayproof.planners import TrajectorySample, truncate


def brake_on_path(course: Course) -> Decided | None:
    """Brake: less of the global path can be driven than the robot needs to stop."""
    if not course.part.too_short:
        return None
    input, state, start, part = course.input, course.state, course.start, course.part
    kept = truncate(state.path, max(part.length, 1e-3))
    if not part.blocked:
        reason = Reason("braking_for_goal")
        return brake(input, state, start, path=kept, reason=reason, label="none")
    found = obstruction.on_path(input, state.path, part.length, input.unknown_blocks)
    reason, label = braking_reason(found)
    return brake(input, state, start, path=kept, reason=reason, label=label)


def wait_on_path(course: Course) -> Decided | None:
    """Wait at rest: something blocks the global path before an advance that is worth it."""
    if not course.is_blocked_at_rest:
        return None
    input, state = course.input, course.state
    found = obstruction.on_path(input, state.path, course.part.length, input.unknown_blocks)
    return wait(input, state, course.start, label_ahead(found), obstructed("waiting", found))


def follow_global_path(situation: Situation) -> Decided:
    """Commit to the traversable part of the global path, ending at rest."""
    planned, start = situation.planned, situation.start
    decided = follow(situation.heading_for, planned.state, start, previous=situation.state)
    return searched(decided, planned)


def follow(
    input: PlannerInput, state: PlannerState, start: TrajectorySample, previous: PlannerState
) -> Decided:
    """Follow the global path of a planner state, as the gait has it.

    Args:
        input: Planner input of the decision.
        state: Planner state with the global path from `start` on.
        start: Start of the new trajectory.
        previous: Planner state before the decision, with the last global path.
    """
    part = drivable_part(input, state.path, start)
    return first_that_applies(input.gait.following, Course(input, state, start, previous, part))
