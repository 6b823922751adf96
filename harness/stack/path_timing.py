"""Timing of a global path: trajectories along it, how long it takes, and where to bend off it.

A body that need not face along its path, as a drone that flies sideways, may bend early. Within the
distance that it takes to stop, it can leave its path along any bend that its speed allows, if it
can come to rest on the new path as well as on the old one.
"""

from __future__ import annotations

from collections.abc import Callable

from wayproof.harness.stack.types import Array, PlannerInput, arc_length
from wayproof.planners import (
    PathState,
    Plan,
    SlowEnd,
    Trajectory,
    TrajectorySample,
    follow_path,
    keeps_limits,
    time_along,
    truncate,
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


Found = tuple[Plan, Array | None]
"""A search, and the path (n, 3) that it found."""


def fastest_found(
    input: PlannerInput, start: TrajectorySample, prefix: Array, search: Callable[[Array], Found]
) -> Found:
    """Search from the end of a prefix and, if the body bends early, from places on it.

    Args:
        input: Planner input of the decision.
        start: Start of the new trajectory.
        prefix: (n, 3) of the present path, to where the body can stop, m.
        search: Plans from the end of a part of the prefix.

    Returns:
        The path that takes the least time to drive, of those along which the body keeps its limits.
        Without any early one, the one from the end of the prefix.
    """
    last = search(prefix)
    shares = input.gait.early_bends
    if len(prefix) == 1 or not shares:
        return last
    early = [search(truncate(prefix, share * arc_length(prefix))) for share in shares]
    found = [one for one in early if _stops_in_admitted(input, start, one[1])]
    if last[1] is not None:
        found.append(last)
    return min(found, key=lambda one: _time(input, start, one), default=last)


def _time(input: PlannerInput, start: TrajectorySample, found: Found) -> float:
    assert found[1] is not None
    return travel_time(input, start, found[1])


def _stops_in_admitted(input: PlannerInput, start: TrajectorySample, path: Array | None) -> bool:
    """Return whether the admitted part of a path can be driven to rest within all limits."""
    if path is None:
        return False
    part = truncate(path, input.traversable.free_length(path))
    state = PathState(input.effect_ns, 0.0, start.speed, start.acceleration, start.heading)
    return keeps_limits(part, state, input.gait.limits, input.gait.sideways_speed)
