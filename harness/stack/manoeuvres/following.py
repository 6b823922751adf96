"""Following the global path: drive its traversable part, brake where it ends, keep the course."""

from __future__ import annotations

from wayproof.harness.stack import obstruction
from wayproof.harness.stack.footprint_checks import first_misfit, poses_from
from wayproof.harness.stack.manoeuvres.driving import drive
from wayproof.harness.stack.manoeuvres.stopping import brake, searched, wait
from wayproof.harness.stack.obstruction import braking_reason, label_ahead, obstructed
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.situation import Course, Situation, drivable_part, first_that_applies
from wayproof.harness.stack.state import PlannerState
from wayproof.harness.stack.types import Command, Decided, PlannerInput, arc_length
from wayproof.planners import TrajectorySample, remaining, truncate


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


def keep_admitted_trajectory(course: Course) -> Decided | None:
    """Keep the last trajectory of an elongated body in motion that need not brake for the path.

    As where it steps aside, at a heading that is not that of its path. The footprint has to fit
    along the trajectory to its rest.
    """
    if not course.part.too_short or not course.headed or course.at_rest:
        return None
    return _kept(course) if _fits(course) else None


def keep_course(course: Course) -> Decided:
    """Keep the last trajectory if the footprint fits along it, else stop on it.

    For an elongated body in motion that does not fit along the new path.
    """
    if _fits(course):
        return _kept(course)
    driven = _drive_last_path(course)
    if driven is not None:
        return driven
    input, trajectory, start = course.input, course.previous.trajectory, course.start
    elapsed = (input.effect_ns - trajectory.start_ns) * 1e-9
    found = obstruction.on_poses(input, poses_from(trajectory, elapsed), input.unknown_blocks)
    path = remaining(trajectory.path, start.arc_length)
    reason, label = braking_reason(found)
    return brake(input, course.state, start, path, reason, label)


def _fits(course: Course) -> bool:
    """Return whether the footprint fits along the rest of the last trajectory."""
    trajectory = course.previous.trajectory
    elapsed = (course.input.effect_ns - trajectory.start_ns) * 1e-9
    return first_misfit(course.input.traversable, trajectory, elapsed) is None


def _kept(course: Course) -> Decided:
    """Return the decision to follow the last trajectory."""
    previous = course.previous
    command = Command(
        "follow",
        Reason("following", free_m=arc_length(previous.trajectory.path)),
        label="none",
        trajectory=previous.trajectory,
        global_path=previous.global_path,
    )
    return Decided(command, _searched_as(course))


def _drive_last_path(course: Course) -> Decided | None:
    """Drive the last global path as far as it still fits; None if that is too short to stop."""
    previous, start = course.previous, course.start
    if previous.route is None:
        return None
    path = remaining(previous.route.path, start.arc_length)
    part = drivable_part(course.input, path, start)
    if part.too_short:
        return None
    return drive(course._replace(state=_searched_as(course).along(path), part=part))


def _searched_as(course: Course) -> PlannerState:
    """Return the state before the decision, with the time of its search for a cheaper path."""
    planned = course.state.route
    if course.previous.route is None or planned is None:
        return course.previous
    return course.previous.searched(planned.improved_ns)
