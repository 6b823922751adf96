"""The situation that a manoeuvre is chosen by, and the course that one of a global path follows."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, TypeVar

from wayproof.harness.behaviour_config import MAX_CORNER_ANGLE, MIN_ADVANCE
from wayproof.harness.stack.footprint_checks import compensate_yaw_lag
from wayproof.harness.stack.global_path import (
    ARRIVED,
    STOP_SLACK,
    GlobalPlan,
    keep_or_replan,
    project_goal_to_free,
)
from wayproof.harness.stack.horizon import goal_within
from wayproof.harness.stack.state import PlannerState
from wayproof.harness.stack.types import (
    Array,
    Decided,
    PlannerInput,
    arc_length,
    distance,
    is_stationary,
)
from wayproof.planners import Trajectory, TrajectorySample, first_stop, remaining, stopping_distance

S = TypeVar("S")


class PlanningGoal(NamedTuple):
    """The goal that the global path leads to.

    Attributes:
        position: (3,) m.
        projected: Whether the mission's goal lies inside the inflation, and this beside it.
    """

    position: Array
    projected: bool


@dataclass(frozen=True)
class Situation:
    """All that a manoeuvre is chosen by; what takes a search is worked out once, where asked for.

    Attributes:
        input: Planner input of this decision.
        state: Planner state before the decision.
        setpoint: Commanded state at the time of the sweep.
        start: Start of the new trajectory: the commanded state at the time of effect.
    """

    input: PlannerInput
    state: PlannerState
    setpoint: TrajectorySample
    start: TrajectorySample

    @cached_property
    def goal(self) -> PlanningGoal:
        """The mission's goal, its projection to free space, or an intermediate one."""
        goal = goal_within(self.input, self.state, self.start)
        if goal is not self.input.goal:  # an intermediate one, which is projected already
            return PlanningGoal(goal, projected=False)
        free = project_goal_to_free(self.input)
        return PlanningGoal(free, projected=free is not goal)

    @property
    def rests_beside_goal(self) -> bool:
        """Whether the robot rests at the projection of a goal inside the inflation."""
        if not self.setpoint.at_rest or not self.goal.projected:
            return False
        return distance(self.start.position, self.goal.position) < ARRIVED

    @property
    def rests_at_path_end(self) -> bool:
        """Whether the robot rests at the end of its path to the goal."""
        state = self.state
        if not self.setpoint.at_rest or state.global_path is None or state.exploring:
            return False
        return arc_length(remaining(state.global_path, self.start.arc_length)) < ARRIVED

    @cached_property
    def heading_for(self) -> PlannerInput:
        """The planner input with the goal that the global path leads to."""
        return replace(self.input, goal=self.goal.position)

    @cached_property
    def planned(self) -> GlobalPlan:
        """The global path, kept or replanned."""
        return keep_or_replan(self.heading_for, self.state, self.start)


def situation_of(input: PlannerInput, state: PlannerState) -> Situation:
    """Return the situation of a decision by its planner input and state."""
    setpoint = not_yet_superseded(input, state)[0].at(input.time_ns)
    start = compensate_yaw_lag(input, setpoint, state.trajectory.at(input.effect_ns))
    return Situation(input, state, setpoint, start)


def not_yet_superseded(input: PlannerInput, state: PlannerState) -> tuple[Trajectory, ...]:
    """Return the committed trajectories from the one followed at the time of the sweep on."""
    committed = state.committed
    begun = [k for k, trajectory in enumerate(committed) if trajectory.start_ns <= input.time_ns]
    return committed[begun[-1] if begun else 0 :]


def first_that_applies(manoeuvres: Iterable[Callable[[S], Decided | None]], at: S) -> Decided:
    """Return the decision of the first manoeuvre that has one; the last one always has."""
    return next(decided for one in manoeuvres if (decided := one(at)) is not None)


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
