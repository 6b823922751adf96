"""Paths over a costmap, and trajectories along them."""

if __name__ != "wayproof.planners":  # from the root of a clone, where it would be a second copy
    raise ImportError("got 'import planners', expected 'import wayproof.planners'")

from dataclasses import replace

import numpy as np

from wayproof.planners.astar.lattice import entry_cell, make_lattice, set_column_heuristic
from wayproof.planners.astar.se2 import se2_path
from wayproof.planners.body import Body, Disc
from wayproof.planners.free_space import CLEARANCE_WEIGHT, FreeSpace
from wayproof.planners.frontier import best_frontier
from wayproof.planners.kernels.angles import yaw_of_direction
from wayproof.planners.kernels.grid import Floats
from wayproof.planners.ompl.state_spaces import STATE_SPACES
from wayproof.planners.path import (
    arc_lengths,
    blend_corners,
    first_stop,
    point_at,
    remaining,
    speed_limits,
    tangent_at,
    truncate,
    without_hooks,
)
from wayproof.planners.problem import Plan, PlanLabel, PlannerConfig, plan, plan_seed
from wayproof.planners.registry import (
    PLANNERS,
    is_registered,
    planner_traits,
    state_space_for,
)
from wayproof.planners.speed_profile import stopping_distance, stopping_speeds
from wayproof.planners.speed_zones import SlowEnd
from wayproof.planners.trajectory import MotionLimits, Setpoints, Trajectory, TrajectorySample
from wayproof.planners.trajectory_generation import (
    PathState,
    follow_path,
    hold,
    keeps_limits,
    stop_along,
    time_along,
    turn_in_place,
)

__all__ = [
    "CLEARANCE_WEIGHT",
    "PLANNERS",
    "STATE_SPACES",
    "Body",
    "Disc",
    "FreeSpace",
    "MotionLimits",
    "PathState",
    "Plan",
    "PlanLabel",
    "PlannerConfig",
    "Setpoints",
    "SlowEnd",
    "Trajectory",
    "TrajectorySample",
    "arc_lengths",
    "best_frontier",
    "blend_corners",
    "first_stop",
    "follow_path",
    "hold",
    "is_registered",
    "keeps_limits",
    "plan",
    "plan_seed",
    "planner_traits",
    "point_at",
    "remaining",
    "speed_limits",
    "state_space_for",
    "stop_along",
    "stopping_distance",
    "stopping_speeds",
    "tangent_at",
    "time_along",
    "truncate",
    "turn_in_place",
    "warm_up",
    "without_hooks",
]


def warm_up(config: PlannerConfig | None = None, oriented: bool = False) -> None:
    """Compile the kernels of plans and trajectories, or load them from the cache.

    Args:
        config: The planner; None for all planners.
        oriented: Whether the body is several discs, and not one disc or ball.
    """
    field = np.full((20, 20, 1), 100, dtype=np.uint16)
    space = FreeSpace(
        field,
        origin=np.zeros(3),
        resolution=0.1,
        collision_distance_sq=4,
        cost_by_distance=np.zeros(101),
    )
    start, goal = np.array([0.25, 0.25, 0.05]), np.array([1.75, 1.75, 0.05])
    if config is None or oriented:
        _warm_up_poses(start, goal)
    if config is None:
        _warm_up_samplers(start, goal)
    sampled = PlannerConfig(name="rrtconnect")
    if config is not None and not is_registered(config.name):
        config = sampled  # a user's code is run in episodes only, where its failures are logged
    for one in [PlannerConfig(), sampled] if config is None else [config]:
        plan(space, start, goal, one, seed=1)
    distances = np.full((20, 20, 20), 100, dtype=np.uint16)
    flown, (near, far) = replace(space, distances=distances), ([0.5] * 3, [1.5, 1.5, 0.5])
    plan(flown, np.array(near), np.array(far), PlannerConfig(), seed=1)
    long = make_lattice(flown, factor=1, weight=1.0)
    goal_cell, start_cell = (entry_cell(long, flown, np.array(end)) for end in (near, far))
    set_column_heuristic(long, goal_cell, start_cell)
    corner = np.array([start, [1.75, 0.25, 0.05], goal])
    path = blend_corners(space, corner, blend_length=0.4)
    space.free_length(path)
    space.first_forbidden(path)
    space.first_forbidden_pose(np.column_stack((path, np.zeros(len(path)))))
    first_stop(path, 0.0)
    tangent_at(truncate(remaining(path, 0.1), 0.2), 0.0)
    space.nearest_free(start, radius=0.5)
    limits = MotionLimits(
        speed=1.0, acceleration=2.0, jerk=10.0, lateral_acceleration=1.0, yaw_rate=1.0
    )
    at_rest = PathState(time_ns=0, arc_length=0.0, speed=0.0, acceleration=0.0, heading=0.0)
    trajectory = follow_path(path, at_rest, limits, speed_cap=1.0)
    trajectory.setpoints(np.zeros(1, np.int64))
    turning = replace(limits, yaw_acceleration=4.0)
    slow_end = SlowEnd(0.5, speed=0.4)
    follow_path(path, at_rest, turning, speed_cap=1.0, sideways_speed=0.5, slow_end=slow_end)
    point_at(path, 0.1)
    yaw_of_direction(1.0, 0.0)
    turn_in_place(start, start_ns=0, heading=0.0, target_heading=1.0, limits=limits)


def _long_space() -> FreeSpace:
    body = Body((-0.2, 0.0, 0.2), (0.1, 0.1, 0.1)).discs(margin=0.0, resolution=0.1, flat=True)
    field = np.full((20, 20, 1), 100, dtype=np.uint16)
    return FreeSpace(
        field,
        origin=np.zeros(3),
        resolution=0.1,
        collision_distance_sq=2,
        cost_by_distance=np.zeros(101),
        discs=body,
    )


def _warm_up_poses(start: Floats, goal: Floats) -> None:
    """Compile for a body of several discs: A*, and its motion along paths."""
    space = _long_space()
    plan(space, start, goal, PlannerConfig(), seed=1)
    poses = np.array([[*start, 0.0], [*goal, 0.0]])
    se2_path(space, (*start.tolist(), 0.0), (*goal.tolist(), 0.0), budget=100)
    space.free_sweep_length(poses)
    space.free_poses(poses)
    space.free_length(poses[:, :3])
    space.first_forbidden(poses[:, :3])
    space.nearest_pose(start, 0.2, np.zeros(1))


def _warm_up_samplers(start: Floats, goal: Floats) -> None:
    """Compile for a body of several discs: planners that sample."""
    space = _long_space()
    plan(space, start, goal, PlannerConfig(name="rrtconnect"), seed=1)
    curved = PlannerConfig(name="rrtconnect", state_space="dubins", turning_radius=0.2, restarts=1)
    plan(space, start, goal, curved, seed=1)
