"""Driving a part of the global path: how far, how fast, and where the footprint fits."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from wayproof.harness.behaviour_config import MAX_CORNER_ANGLE, MIN_ADVANCE
from wayproof.harness.stack.diagnosis import diagnose_driving
from wayproof.harness.stack.footprint_checks import (
    MIN_PATH,
    first_misfit,
    moves_tail_first,
    truncate_where_turnable,
)
from wayproof.harness.stack.global_path import STOP_SLACK
from wayproof.harness.stack.path_timing import plan_trajectory
from wayproof.harness.stack.state import PlannerState
from wayproof.harness.stack.types import (
    Array,
    Command,
    Decided,
    PlannerInput,
    arc_length,
    is_stationary,
)
from wayproof.planners import (
    SlowEnd,
    Trajectory,
    TrajectorySample,
    first_stop,
    stopping_distance,
    truncate,
)

MAX_SHORTENINGS = 8
"""Number of times that a path is shortened to make the footprint fit along it.

Each time it ends earlier, the body turns later on it, and may not fit there, either.
"""

MISFIT_MARGIN = 0.02
"""Distance kept before the first place where the footprint does not fit, m."""

CORNER_OVERRUN = 0.03
"""Distance beyond a corner within which an elongated body that stops still turns into it, m."""


class DrivablePart(NamedTuple):
    """The part of the global path, from its beginning on, that the robot may drive now.

    Attributes:
        length: Up to what is not traversable, a corner too sharp to drive, or the end, m.
        blocked: Whether what is not traversable ends it.
        too_short: Whether the robot needs more to stop.
    """

    length: float
    blocked: bool
    too_short: bool = False


class Course(NamedTuple):
    """A global path to follow.

    Attributes:
        input: Planner input of the decision.
        state: Planner state with the global path from `start` on.
        start: Start of the new trajectory.
        previous: Planner state before the decision, with the last global path.
        part: Part of the path that the robot may drive now.
    """

    input: PlannerInput
    state: PlannerState
    start: TrajectorySample
    previous: PlannerState
    part: DrivablePart

    @property
    def at_rest(self) -> bool:
        """Whether the robot does not translate."""
        return is_stationary(self.start)

    @property
    def is_blocked_at_rest(self) -> bool:
        """Whether something blocks the path before an advance that is worth leaving rest for."""
        return self.at_rest and self.part.blocked and self.part.length < MIN_ADVANCE

    @property
    def headed(self) -> bool:
        """Whether the body is checked at its heading."""
        return bool(self.input.traversable.discs)


def drivable_part(input: PlannerInput, path: Array, start: TrajectorySample) -> DrivablePart:
    """Return the part of a path (n, 3) that is traversable and without a corner to stop at."""
    whole = arc_length(path)
    traversable = input.traversable.free_length(path)
    corner = whole
    if not input.gait.sideways_speed:
        corner = first_stop(path, 0.0, MAX_CORNER_ANGLE)
    braking = stopping_distance(start.speed, start.acceleration, input.gait.limits)
    overrun = CORNER_OVERRUN if input.traversable.discs else 0.0
    if corner < braking - overrun:  # too late to stop there: the profile slows down for it
        corner = whole
    length = min(traversable, corner, whole)
    return DrivablePart(
        length,
        blocked=length == traversable and traversable < whole,
        too_short=length < braking - STOP_SLACK - (overrun if length == corner else 0.0),
    )


def drive(course: Course) -> Decided | None:
    """Drive the part of the global path; None if the footprint does not fit, or too little of it.

    Tail first, if an elongated body in motion is on it so.
    """
    return drive_along(course, moves_tail_first(course.input, course.start, course.state.path))


def drive_along(course: Course, tail_first: bool) -> Decided | None:
    """Drive the part of the global path, nose or tail first; None as of `drive`."""
    input, state, start, _, part = course
    path = truncate(state.path, part.length)
    if tail_first:
        braking = stopping_distance(start.speed, start.acceleration, input.gait.limits)
        path = truncate_where_turnable(input.traversable, path, braking)
    slow_end = _unknown_end(input, path)
    doubtful = input.uncertain or input.noisy
    share = input.behaviour.uncertain_speed_fraction if doubtful else 1.0
    trajectory = fit_trajectory(input, start, path, share, tail_first, slow_end)
    if trajectory is None:
        return None
    action, reason, label = diagnose_driving(
        input,
        state,
        start,
        trajectory,
        part.length,
        blocked=part.blocked,
        slowed=slow_end is not None,
    )
    command = Command(action, reason, label, trajectory, state.path)
    return Decided(command, state)


def _unknown_end(input: PlannerInput, path: Array) -> SlowEnd | None:
    """Return where unknown space begins to cost speed on a path (n, 3); None if it nowhere does."""
    if not input.penalize_unknown:
        return None
    known = input.known_free.free_length(path)
    if known >= arc_length(path):
        return None
    return SlowEnd(known, input.behaviour.unknown_speed_fraction * input.gait.limits.speed)


def fit_trajectory(
    input: PlannerInput,
    start: TrajectorySample,
    path: Array,
    speed_share: float,
    tail_first: bool,
    slow_end: SlowEnd | None = None,
) -> Trajectory | None:
    """Plan a trajectory along a path, shortened to where the footprint fits at each heading.

    Args:
        input: Planner input of the decision.
        start: Start of the new trajectory.
        path: (n, 3), m.
        speed_share: Share of full speed.
        tail_first: Whether an elongated body moves backwards.
        slow_end: A further speed limit towards the end of the path.

    Returns:
        None if that leaves less than the robot needs to stop.
    """
    if tail_first:
        speed_share = min(speed_share, input.behaviour.reverse_speed_fraction)
    if input.traversable.discs:
        speed_share = min(speed_share, input.behaviour.narrow_speed_fraction)
    braking = stopping_distance(start.speed, start.acceleration, input.gait.limits)
    return shortened_to_fit(
        input,
        path,
        max(braking, MIN_PATH),
        lambda way: plan_trajectory(
            input,
            start,
            path=way,
            speed_share=speed_share,
            tail_first=tail_first,
            slow_end=slow_end,
        ),
    )


def shortened_to_fit(
    input: PlannerInput, path: Array, least: float, plan: Callable[[Array], Trajectory]
) -> Trajectory | None:
    """Plan along a path (n, 3), shortened until the footprint fits; None below `least`, m."""
    for _ in range(MAX_SHORTENINGS):
        trajectory = plan(path)
        misfit = first_misfit(input.traversable, trajectory)
        if misfit is None:
            return trajectory
        end = misfit - MISFIT_MARGIN
        if end < least:
            return None
        path = truncate(path, end)
    return None
