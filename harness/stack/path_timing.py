"""Timing of a global path: trajectories along it, and how long it takes to drive."""

from __future__ import annotations

from wayproof.harness.stack.types import Array, PlannerInput
from wayproof.planners import (
    PathState,
    SlowEnd,
    Trajectory,
    TrajectorySample,
    follow_path,
    time_along,
)


def at_begin(input: PlannerInput, start: TrajectorySample) -> PathState:
    """Return the state of a robot that enters a path at its first point.

    Args:
        input: Planner input of the decision.
        start: Sample of the present trajectory at the time of effect.
    """
    return PathState(
        time_ns=input.effect_ns,
        arc_length=0.0,
        speed=start.speed,
        acceleration=start.acceleration,
        heading=start.heading,
        yaw_rate=start.yaw_rate,
    )


def plan_trajectory(
    input: PlannerInput,
    start: TrajectorySample,
    path: Array,
    speed_share: float,
    tail_first: bool = False,
    slow_end: SlowEnd | None = None,
) -> Trajectory:
    """Time-parameterize a path (n, 3) at a share of full speed, ending at rest.

    Args:
        input: Planner input of the decision.
        start: Sample of the present trajectory at the time of effect.
        path: (n, 3), m.
        speed_share: Share of full speed.
        tail_first: Whether an elongated body moves backwards.
        slow_end: A further speed limit towards the end of the path.
    """
    return follow_path(
        path,
        start=at_begin(input, start),
        limits=input.gait.limits,
        speed_cap=speed_share * input.gait.limits.speed,
        reverse=tail_first,
        sideways_speed=input.gait.sideways_speed,
        slow_end=slow_end,
    )


def travel_time(input: PlannerInput, start: TrajectorySample, path: Array) -> float:
    """Time to the end of a path (n, 3) from the start of a trajectory, were it all free, s."""
    return time_along(
        path,
        start=at_begin(input, start),
        limits=input.gait.limits,
        speed_cap=input.gait.limits.speed,
        sideways_speed=input.gait.sideways_speed,
    )
