"""A planning problem: from a start to a goal through free space, within a counted budget."""

from __future__ import annotations

import functools
import hashlib
import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from wayproof.bounds import Bounds, check_fields
from wayproof.planners.free_space import CLEARANCE_WEIGHT, FreeSpace
from wayproof.planners.kernels import angles, polyline, pose_shortcut, shortcut
from wayproof.planners.kernels.grid import Floats, Pose
from wayproof.planners.ompl.search import Query, search
from wayproof.planners.ompl.state_spaces import STATE_SPACES, StateSpace
from wayproof.planners.registry import (
    PLANNERS,
    Budget,
    planner_builder,
    planner_traits,
    state_space_for,
)

DETOUR_REACH = 1.0
"""Largest distance of a detour's apex from the middle of the cut, along each axis, m."""

GOAL_HEADINGS = 16
"""Number of headings that are tried at a goal with none given."""

GRAIN = 2.0**-30
"""Grain of the coordinates, m, and headings, rad, of what OMPL finds: a nanometre, a million times
their last bits. Its curves and informed samples rest on functions of the C library, whose last bits
follow the processor. The planner `astar` needs none."""

PlanLabel = Literal["none", "no_path", "start_blocked", "goal_blocked"]


__all__ = ["PLANNERS", "Plan", "PlanLabel", "PlannerConfig", "plan"]


@dataclass(frozen=True)
class PlannerConfig:
    """The planner and its budget.

    Attributes:
        name: A key of `PLANNERS`, or `module:Class` of a user's own `ompl.base.Planner`, a class
            that is made from a `SpaceInformation`.
        iterations: Iterations of the planner's own loop for one plan, shared by its restarts.
        restarts: Searches from other seeds; the cheapest path wins. A planner that
            improves its first path spends the whole budget on it and never restarts.
        shortcuts: Attempts to cut or bend each search's path.
        clearance_weight: Weight of the cost of coming near obstacles against length.
        corner_cost: Cost of a corner of a path, m of length: at a corner a robot slows down. 0.2 m
            is what a drone at 2 m/s loses where it brakes to 1.3 m/s at 2.5 m/s^2. It weighs on
            shortcuts where positions are planned; a turn of the body has a cost of its own.
        switch_ratio: Hysteresis: a path that is still valid is replaced only by one that costs less
            than this fraction of it, so that the plan does not flip between sides.
        state_space: State space: `position`, `pose`, `reeds_shepp`, `dubins`, or `auto`: a pose
            where the body is checked at its heading, else a position.
        turning_radius: Least radius of `reeds_shepp` and `dubins` curves, m.

    Raises:
        ValueError: If a field is out of its range.
    """

    name: str = "astar"
    iterations: Annotated[int, Bounds(1, 1e9)] = 2000
    restarts: Annotated[int, Bounds(1, 1e6)] = 4
    shortcuts: Annotated[int, Bounds(0, 1e6)] = 300
    clearance_weight: Annotated[float, Bounds(0.0, 1e6)] = CLEARANCE_WEIGHT
    corner_cost: Annotated[float, Bounds(0.0, 1e6, "m")] = 0.2
    switch_ratio: Annotated[float, Bounds(1e-9, 1.0)] = 0.9
    state_space: str = "auto"
    turning_radius: Annotated[float, Bounds(1e-9, 1e6, "m")] = 0.5

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self, "planner.")
        planner_builder(self.name)
        if self.state_space not in ("auto", *STATE_SPACES):
            available = ", ".join(("auto", *STATE_SPACES))
            got = repr(self.state_space)
            raise ValueError(f"planner.state_space: got {got}, expected one of {available}")
        curved = self.state_space in ("reeds_shepp", "dubins")
        if curved and not planner_traits(self.name).curves:
            got = f"{self.state_space} for the planner {self.name}"
            raise ValueError(f"planner.state_space: got {got}, expected auto, position or pose")

    def replaces(self, new_cost: float, old_cost: float) -> bool:
        """Return whether a new path should replace a valid old one, by their costs, m."""
        return new_cost < self.switch_ratio * old_cost


def state_space_of(config: PlannerConfig, space: FreeSpace) -> StateSpace:
    """Return the state space that is planned in, in a free space.

    Raises:
        ValueError: If the state space does not suit the body, the grid or the planner.
    """
    return state_space_for(
        config.state_space, config.name, flat=space.flat, discs=bool(space.discs)
    )


@dataclass(frozen=True)
class Plan:
    """A path, or the reason that there is none.

    Attributes:
        waypoints: Waypoints from the start to the goal, m, shape (n, 3), free edge by edge; None
            without a path.
        cost: Length plus weighted nearness to obstacles, m; infinite without a path.
        length: Length, m; infinite without a path.
        least_clearance: Least distance of the reference point to a blocked cell along the path, m;
            0 without a path.
        iterations: Iterations of the planner's loop that were used.
        label: `none`, or the reason that there is no path: `no_path` within the budget,
            `start_blocked`, `goal_blocked`.
        headings: Heading of the body at each waypoint, rad, shape (n,), between which it turns
            evenly; None where only positions were planned.
    """

    waypoints: Floats | None
    cost: float
    length: float
    least_clearance: float
    iterations: int
    label: PlanLabel
    headings: Floats | None = None


def plan(
    space: FreeSpace,
    start: Floats,
    goal: Floats,
    config: PlannerConfig,
    seed: int,
    heading: float = 0.0,
    goal_heading: float | None = None,
) -> Plan:
    """Plan the cheapest path that the budget finds; a pure function of its arguments.

    Args:
        space: Free space.
        start: World frame, m, shape (3,).
        goal: World frame, m, shape (3,).
        config: The planner and its budget.
        seed: Seed of this plan; restarts derive theirs from it.
        heading: Heading of the body at the start, rad, where headings are planned.
        goal_heading: Heading of the body at the goal, rad; None for any: restarts take the headings
            at which it fits there in turn, the one straight ahead from the start first.

    Returns:
        The path with its cost, or a label that says why there is none.

    Raises:
        ValueError: If the state space does not suit the body, the grid or the planner.
    """
    begin = _pose(start, heading)
    kind, traits = state_space_of(config, space), planner_traits(config.name)
    if not _fits(space, kind, begin):
        return _without_path("start_blocked", 0)
    ends = _goal_poses(space, kind, start=begin, goal=goal, heading=goal_heading)
    if not ends:
        return _without_path("goal_blocked", 0)
    best, best_cost, used = None, math.inf, 0
    for restart in range(config.restarts if traits.uses_seed else 1):
        if used >= config.iterations:
            break
        end = ends[restart % len(ends)]
        any_heading = kind.oriented and goal_heading is None and traits.chooses_heading
        query = Query(
            space,
            kind,
            start=begin,
            goal=end,
            turning_radius=config.turning_radius,
            any_heading=any_heading,
        )
        left = config.iterations - used
        poses, spent = _search_once(query, config, left, plan_seed(seed, "restart", restart))
        used += spent
        cost = math.inf if poses is None else _cost(query, poses, config.clearance_weight)
        if cost < best_cost:
            best, best_cost = poses, cost
    if best is None:
        return _without_path("no_path", used)
    return _with_path(space, kind, poses=best, cost=best_cost, used=used)


def smoothed(query: Query, poses: Floats, config: PlannerConfig, seed: int) -> Floats:
    """Lower a path's cost by seeded shortcuts, shape (n, 4); curves stay as they are."""
    space, weight = query.space, float(config.clearance_weight)
    if query.kind.curved or config.shortcuts == 0:
        return poses
    draws = shortcut_draws(config.shortcuts, not space.flat, seed)
    if query.kind.oriented:
        return pose_shortcut.shortcut_poses(space.grid, space.shape, weight, poses, draws)
    points = np.ascontiguousarray(poses[:, :3])
    threshold, corner = space.collision_distance_sq, float(config.corner_cost)
    path = shortcut.shortcut(space.grid, threshold, weight, corner, points, draws)
    return np.column_stack((path, np.zeros(len(path))))


def _pose(point: Floats, heading: float) -> Pose:
    yaw = float(angles.wrap(heading))  # can be beyond -pi by a rounding, which OMPL refuses
    return float(point[0]), float(point[1]), float(point[2]), min(max(yaw, -math.pi), math.pi)


def _fits(space: FreeSpace, kind: StateSpace, pose: Pose) -> bool:
    if kind.oriented:
        return space.sweep_free(np.array(pose), np.array(pose))
    return space.is_free(np.array(pose[:3]))


def _goal_poses(
    space: FreeSpace, kind: StateSpace, start: Pose, goal: Floats, heading: float | None
) -> list[Pose]:
    """Return free poses at the goal, the preferred one first."""
    if not kind.oriented:
        headings = [0.0]
    elif heading is not None:
        headings = [heading]
    else:
        ahead = float(angles.yaw_of_direction(goal[0] - start[0], goal[1] - start[1]))
        turns = sorted(range(GOAL_HEADINGS), key=lambda n: min(n, GOAL_HEADINGS - n))
        headings = [angles.wrap(ahead + n * angles.TURN / GOAL_HEADINGS) for n in turns]
    poses = [_pose(goal, heading) for heading in headings]
    return [pose for pose in poses if _fits(space, kind, pose)]


def _cost(query: Query, poses: Floats, weight: float) -> float:
    if query.kind.oriented:
        return query.space.sweep_cost(poses, weight)
    return query.space.path_cost(poses[:, :3], weight)


def _with_path(space: FreeSpace, kind: StateSpace, poses: Floats, cost: float, used: int) -> Plan:
    path = np.ascontiguousarray(poses[:, :3])
    return Plan(
        waypoints=path,
        cost=cost,
        length=float(polyline.path_length(path)),
        least_clearance=space.least_clearance(path),
        iterations=used,
        label="none",
        headings=poses[:, 3].copy() if kind.oriented else None,
    )


def _without_path(label: PlanLabel, iterations: int) -> Plan:
    return Plan(
        waypoints=None,
        cost=math.inf,
        length=math.inf,
        least_clearance=0.0,
        iterations=iterations,
        label=label,
    )


def _search_once(
    query: Query, config: PlannerConfig, iterations: int, seed: int
) -> tuple[Floats | None, int]:
    """Search once and shorten: the path if there is one, and the iterations used."""
    if query.start == query.goal or not _can_plan(query, config.name):
        return np.array([query.start, query.goal], dtype=np.float64), 1
    budget = Budget(iterations, config.clearance_weight, seed)
    poses, used = search(query, config.name, budget, seed, simplifications=config.shortcuts)
    if poses is not None and planner_traits(config.name).uses_seed:
        poses[1:-1] = np.rint(poses[1:-1] / GRAIN) * GRAIN
    if poses is None or math.isinf(_cost(query, poses, config.clearance_weight)):
        return None, used
    return smoothed(query, poses, config, seed), used


def _can_plan(query: Query, name: str) -> bool:
    """Return whether a planner takes these ends: poses of one place are one state of R2 or R3."""
    turn_alone = not query.kind.oriented and query.start[:3] == query.goal[:3]
    return not turn_alone or planner_traits(name).coincident_ends


@functools.lru_cache(maxsize=4)
def shortcut_draws(count: int, spatial: bool, seed: int) -> Floats:
    """Draw two places along the path and an apex offset, m, for each attempt, shape (count, 5).

    The cube of a uniform draw keeps most offsets small, where they refine, and some large. A
    decision searches from several places with one seed: the draws are kept, and only to be read.
    """
    draws = np.random.Generator(np.random.PCG64(seed)).random((count, 5))
    centred = 2.0 * draws[:, 2:] - 1.0  # (count, 3)
    draws[:, 2:] = DETOUR_REACH * centred * centred * centred
    if not spatial:
        draws[:, 4] = 0.0
    return draws


LARGEST_SEED = 2**31 - 1


def plan_seed(episode_seed: int, stream: str, sequence: int) -> int:
    """Return the seed of one draw of one stream: BLAKE2b (RFC 7693) of its three names.

    Args:
        episode_seed: Seed of the episode.
        stream: Name of the stream, such as `"plan"`.
        sequence: Number of the draw within the stream.

    Returns:
        Integer in [1, 2**31 - 1]; OMPL does not accept 0.
    """
    name = f"{episode_seed}/{stream}/{sequence}".encode()
    digest = hashlib.blake2b(name, digest_size=8).digest()
    return int.from_bytes(digest, "little") % LARGEST_SEED + 1
