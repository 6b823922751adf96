"""Keeping the course of an elongated body in motion that does not fit along the new path."""

from __future__ import annotations

from wayproof.harness.stack import obstruction
from wayproof.harness.stack.course import Course, drivable_part
from wayproof.harness.stack.footprint_checks import first_misfit, poses_from
from wayproof.harness.stack.manoeuvres.driving import drive
from wayproof.harness.stack.manoeuvres.stopping import brake
from wayproof.harness.stack.obstruction import braking_reason
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.state import PlannerState
from wayproof.harness.stack.types import Command, Decided, arc_length
from wayproof.planners import remaining


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
