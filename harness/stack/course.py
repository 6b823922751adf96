"""The course that a manoeuvre along a global path is chosen by."""

from __future__ import annotations

from typing import NamedTuple

from wayproof.harness.behaviour_config import MAX_CORNER_ANGLE, MIN_ADVANCE
from wayproof.harness.stack.global_path import STOP_SLACK
from wayproof.harness.stack.state import PlannerState
from wayproof.harness.stack.types import Array, PlannerInput, arc_length, is_stationary
from wayproof.planners import TrajectorySample, first_stop, stopping_distance

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
