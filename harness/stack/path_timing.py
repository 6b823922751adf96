"""Timing of a global path: trajectories along it, and how long it takes to drive."""

from __future__ import annotations

from wayproof.harness.stack.types import Array, PlannerInput
from wayproof.planners import PathState, Trajectory, TrajectorySample, follow_path


def plan_trajectory(
    input: PlannerInput,
    start: TrajectorySample,
    path: Array,
    speed_share: float,
    tail_first: bool = False,
) -> Trajectory:
    """Time-parameterize a path (n, 3) at a share of full speed, ending at rest."""
    return follow_path(
        path,
        PathState(input.effect_ns, 0.0, start.speed, start.acceleration, start.heading),
        input.limits,
        speed_share * input.limits.speed,
        tail_first,
        input.sideways_speed,
        input.behaviour.whole_bends,
    )


def travel_time(input: PlannerInput, start: TrajectorySample, path: Array) -> float:
    """Time to the end of a path (n, 3) from the start of a trajectory, were it all free, s."""
    return plan_trajectory(input, start, path, speed_share=1.0).duration_s
