"""`wayproof bench plan`: paths of 14 to 16 m across a warehouse at 5 cm, for both robots.

Lengths are compared with clearance weight 0 and no price of corners on both sides, against Lazy
Theta* on the 5 cm grid with a thousand shortcuts (`reference`). Times are processor time of one
thread. The last rows plan by default, so they are longer, keep farther away and have fewer corners.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from wayproof.harness.bench.micro.lazy_theta import reference_path, scratch_for
from wayproof.harness.bench.table import Progress
from wayproof.maps import collision_distance_sq
from wayproof.planners import (
    PLANNERS,
    Body,
    FreeSpace,
    GoalField,
    MotionLimits,
    PathState,
    Plan,
    PlannerConfig,
    blend_corners,
    follow_path,
    plan,
    plan_seed,
    point_at,
    warm_up,
)
from wayproof.planners.kernels import polyline

Array = NDArray[np.float64]
Given = ParamSpec("Given")
Result = TypeVar("Result")
Spaces = tuple[FreeSpace, FreeSpace]  # the body's, and that of its inscribed disc or ball

RESOLUTION = 0.05  # m
SIZE = (20.0, 20.0, 3.0)  # m
REACH = 30  # cells, greatest distance of the field
MARGIN = 0.05  # m, localization
DRONE = Body((0.0,), (0.3,))
QUADRUPED = Body((-0.2, 0.0, 0.2), (0.2, 0.2, 0.2))
BAND = (0.1, 0.6)  # m above the floor, that the quadruped passes
COST_SCALE = 4.0  # per m, of Nav2's law exp(-scale (distance - forbidden))
QUERIES_PER_REPEAT = 14
PEER_SHARE = 5
"""Every fifth query goes to the planners that use a seed, all of them to the others."""

BLEND_LENGTH = 0.6  # m
AT_REST = PathState(time_ns=0, arc_length=0.0, speed=0.0, acceleration=0.0, heading=0.0)
LIMITS = {
    "drone": MotionLimits(
        speed=2.0, acceleration=4.0, jerk=30.0, lateral_acceleration=4.0, yaw_rate=2.0
    ),
    "quadruped": MotionLimits(
        speed=0.8, acceleration=1.0, jerk=6.0, lateral_acceleration=1.0, yaw_rate=1.2
    ),
}


@dataclass(frozen=True)
class PlanRow:
    """Results of one planner.

    Attributes:
        robot: Robot in whose space was planned.
        planner: Name of the planner, and its queries.
        queries: Number of plans.
        success: Share of them that found a path.
        p50_ms: Median processor time of a plan, ms.
        p99_ms: 99th percentile of the processor time, ms.
        length_ratio_mean: Length against the reference's; of replanning, against a plan from
            nothing on the same map with the same weight.
        length_ratio_p99: 99th percentile of that ratio.
        clearance_mean_m: Mean distance to what blocks, along the path.
    """

    robot: str
    planner: str
    queries: int
    success: float
    p50_ms: float
    p99_ms: float
    length_ratio_mean: float
    length_ratio_p99: float
    clearance_mean_m: float


@dataclass(frozen=True)
class Query:
    """Query from a start to a goal, with the reference path that lengths are compared with."""

    start: Array
    goal: Array
    heading: float
    seed: int
    reference: Array
    reference_ms: float

    @property
    def length(self) -> float:
        """Length of the reference path, m."""
        return float(polyline.path_length(self.reference))


def bench_plan(repeats: int, seed: int, progress: Progress) -> list[PlanRow]:
    """Time every planner on seeded queries; one flat row for each."""
    progress("compiling kernels (some seconds the first time, then cached)")
    warm_up()
    blocked = warehouse(seed)
    rows: list[PlanRow] = []
    for robot, spaces in (("drone", air(blocked)), ("quadruped", ground(blocked))):
        progress(f"plan: references of the {robot}")
        queries = make_queries(spaces, QUERIES_PER_REPEAT * repeats, seed)
        rows.append(_reference_row(robot, spaces[1], queries))
        for name in PLANNERS:
            progress(f"plan: {robot}, {name}")
            chosen = queries[::PEER_SHARE] if PLANNERS[name].traits.uses_seed else queries
            short = PlannerConfig(name=name, clearance_weight=0.0, corner_cost=0.0)
            rows.append(_plan_row(robot, name, spaces[0], queries=chosen, config=short)[0])
        clear = PlannerConfig(name="astar")
        row, plans = _plan_row(
            robot, name="field, clear", space=spaces[0], queries=queries, config=clear
        )
        progress(f"plan: {robot}, replanning and trajectories")
        rows += [row, *_replan_rows(robot, spaces[0], queries)]
        rows += _trajectory_rows(robot, spaces[0], plans)
    return rows


def warehouse(seed: int) -> NDArray[np.bool_]:
    """Return the blocked cells of a hall with four rows of racks and 45 boxes, some hung up."""
    rng = np.random.default_rng(seed)
    blocked = np.zeros([round(size / RESOLUTION) for size in SIZE], np.bool_)
    for axis in range(3):
        for side in (0, -1):
            np.moveaxis(blocked, axis, 0)[side] = True
    for row in range(4):
        for rack in range(3):
            low = np.array([2.0 + 5.6 * rack + rng.uniform(-0.5, 0.5), 3.0 + 4.2 * row, 0.0])
            size = np.array([rng.uniform(3.0, 4.2), 0.9, rng.uniform(1.2, 2.9)])
            _block(blocked, low, low + size)
    for _ in range(45):
        low = np.array([*rng.uniform(1.0, 18.5, 2), rng.choice([0.0, rng.uniform(0.0, 2.0)])])
        size = np.array([*rng.uniform(0.3, 1.3, 2), rng.uniform(0.5, 2.2)])
        _block(blocked, low, low + size)
    return blocked


def _block(blocked: NDArray[np.bool_], low: Array, high: Array) -> None:
    first, end = (np.round(corner / RESOLUTION).astype(int) for corner in (low, high))
    blocked[tuple(slice(a, b) for a, b in zip(first, end, strict=True))] = True


def air(blocked: NDArray[np.bool_]) -> Spaces:
    """Return the drone's space: a ball in three dimensions."""
    return _spaces(blocked, DRONE, flat=False)


def ground(blocked: NDArray[np.bool_]) -> Spaces:
    """Return the quadruped's space: discs in the plane, and the disc about its middle."""
    low, high = (round(height / RESOLUTION) for height in BAND)
    columns = np.asarray(blocked[:, :, low:high].any(axis=2))  # (nx, ny)
    return _spaces(columns[:, :, None], QUADRUPED, flat=True)


def _spaces(blocked: NDArray[np.bool_], body: Body, flat: bool) -> Spaces:
    threshold = collision_distance_sq(min(body.radii) + MARGIN, RESOLUTION, flat)
    distances = np.sqrt(np.arange(REACH * REACH + 1)) - math.sqrt(threshold)  # cells beyond
    costs = np.exp(-COST_SCALE * RESOLUTION * np.maximum(distances, 0.0))
    costs[-1] = 0.0
    field = squared_distances(blocked)
    point = FreeSpace(
        field,
        origin=np.zeros(3),
        resolution=RESOLUTION,
        collision_distance_sq=threshold,
        cost_by_distance=costs,
    )
    if len(body.radii) == 1:
        return point, point
    return replace(point, discs=body.discs(MARGIN, RESOLUTION, flat)), point


def squared_distances(blocked: NDArray[np.bool_]) -> NDArray[np.uint16]:
    """Return the squared distance in cells to the nearest blocked one, at most the reach's."""
    squared = np.rint(distance_transform_edt(~blocked) ** 2)
    cells: NDArray[np.uint16] = np.minimum(squared, REACH * REACH).astype(np.uint16)
    return cells


def make_queries(spaces: Spaces, count: int, seed: int) -> list[Query]:
    """Draw pairs of free points 14 to 16 m apart that the reference finds a path between."""
    space, point = spaces
    rng = np.random.default_rng([seed, space.field.shape[2]])
    scratch = scratch_for(point)
    queries: list[Query] = []
    while len(queries) < count:
        start, goal = (_random_point(rng, space) for _ in range(2))
        heading = math.pi * rng.uniform(-1.0, 1.0)
        free = point.is_free(goal) and space.sweep_free(
            _pose(start, heading), _pose(start, heading)
        )
        # A body of discs has to fit at the goal at some heading: here, at any.
        free = free and all(
            space.sweep_free(_pose(goal, turn), _pose(goal, turn)) for turn in np.arange(16) / 2.5
        )
        if not (free and 14.0 <= math.dist(start, goal) <= 16.0):
            continue
        number = plan_seed(seed, "bench", len(queries))
        reference, elapsed = _timed(reference_path, point, start, goal, number, scratch)
        if reference is not None:
            queries.append(
                Query(start, goal, heading, seed=number, reference=reference, reference_ms=elapsed)
            )
    return queries


def _random_point(rng: np.random.Generator, space: FreeSpace) -> Array:
    extent = np.array(space.field.shape) * space.resolution
    point = rng.uniform(0.0, extent)
    if space.flat:
        point[2] = 0.5 * extent[2]
    return point


def _pose(point: Array, heading: float) -> Array:
    return np.append(point, heading)


def _timed(
    work: Callable[Given, Result], *given: Given.args, **named: Given.kwargs
) -> tuple[Result, float]:
    """Return the result of work, and its processor time, ms."""
    started = time.process_time()
    result = work(*given, **named)
    return result, 1e3 * (time.process_time() - started)


def _plan_row(
    robot: str, name: str, space: FreeSpace, queries: list[Query], config: PlannerConfig
) -> tuple[PlanRow, list[Plan]]:
    plans, times = [], []
    for query in queries:
        found, elapsed = _timed(
            plan, space, query.start, query.goal, config, query.seed, query.heading
        )
        plans.append(found)
        times.append(elapsed)
    return _row(
        robot, name, space, plans, times, lengths=[query.length for query in queries]
    ), plans


def _row(
    robot: str, name: str, space: FreeSpace, plans: list[Plan], times: list[float],
    lengths: list[float],
) -> PlanRow:  # fmt: skip
    ratios = [
        one.length / length
        for one, length in zip(plans, lengths, strict=True)
        if one.waypoints is not None
    ] or [math.inf]
    paths = [one.waypoints for one in plans if one.waypoints is not None]
    clearances = [clearance_mean(space, path) for path in paths] or [0.0]
    p50, p99 = np.percentile(times, [50, 99])
    return PlanRow(
        robot=robot,
        planner=name,
        queries=len(plans),
        success=len(paths) / len(plans),
        p50_ms=float(p50),
        p99_ms=float(p99),
        length_ratio_mean=float(np.mean(ratios)),
        length_ratio_p99=float(np.percentile(ratios, 99)),
        clearance_mean_m=float(np.mean(clearances)),
    )


def clearance_mean(space: FreeSpace, path: Array) -> float:
    """Return the mean distance to blocked cells at points one cell apart along a path, m."""
    places = np.arange(0.0, float(polyline.path_length(path)), space.resolution)
    points = np.array([point_at(path, s) for s in places])
    cells = np.floor((points - space.origin) / space.resolution).astype(int)
    return float(np.sqrt(space.field[tuple(cells.T)]).mean()) * space.resolution


def _replan_rows(robot: str, space: FreeSpace, queries: list[Query]) -> Iterator[PlanRow]:
    """Yield plans from kept costs-to-go: the first, again, and after a box came into the way."""
    config = PlannerConfig()
    kept: dict[str, list[tuple[Plan, float, float]]] = {"first": [], "again": [], "changed": []}
    for query in queries:
        field = GoalField(query.goal, config)
        for name in ("first", "again"):
            nothing = None if name == "first" else (np.zeros(3, int), np.zeros(3, int))
            found, elapsed = _timed(
                field.plan, space, query.start, query.seed, query.heading, nothing
            )
            kept[name].append((found, elapsed, found.length))
        if found.waypoints is None:
            continue
        with_box = put_box(space, found.waypoints, query.seed)
        if with_box is None:
            continue
        changed_space, box = with_box
        again, elapsed = _timed(
            field.plan, changed_space, query.start, query.seed, query.heading, box
        )
        fresh = plan(changed_space, query.start, query.goal, config, query.seed, query.heading)
        if fresh.waypoints is not None:
            kept["changed"].append((again, elapsed, fresh.length))
    for name, results in kept.items():
        plans, times, lengths = zip(*results, strict=True)
        yield _row(
            robot,
            name=f"replan, {name}",
            space=space,
            plans=[*plans],
            times=[*times],
            lengths=[*lengths],
        )


def put_box(
    space: FreeSpace, path: Array, seed: int
) -> tuple[FreeSpace, tuple[NDArray[np.int64], NDArray[np.int64]]] | None:
    """Put a box of 0.8 m on the path 2 to 6 m ahead; return the space and the changed cells.

    None if the box is at the start or the goal.
    """
    ahead = np.random.default_rng(seed).uniform(2.0, 6.0)
    shape = np.array(space.field.shape)
    middle = np.floor((point_at(path, ahead) - space.origin) / space.resolution).astype(np.int64)
    low, high = np.maximum(middle - 8, 0), np.minimum(middle + 8, shape)
    first, end = np.maximum(low - REACH, 0), np.minimum(high + REACH, shape)
    window = tuple(slice(a, b) for a, b in zip(first, end, strict=True))
    box = np.zeros(tuple(end - first), np.bool_)
    box[tuple(slice(a, b) for a, b in zip(low - first, high - first, strict=True))] = True
    field = space.field.copy()
    field[window] = np.minimum(field[window], squared_distances(box))
    changed = replace(space, distances=field)
    room = max(abs(o) for o in changed.shape.offsets) + 0.5
    if min(math.dist(path[n], point_at(path, ahead)) for n in (0, -1)) < 0.8 + room:
        return None
    return changed, (first, end)


def _trajectory_rows(robot: str, space: FreeSpace, plans: list[Plan]) -> Iterator[PlanRow]:
    """Yield corners blended, and then the motion timed, for each path found."""
    found = [one for one in plans if one.waypoints is not None]
    lengths = [one.length for one in found]
    limits = LIMITS[robot]
    blends, blend_times, times = [], [], []
    for one in found:
        assert one.waypoints is not None
        path, elapsed = _timed(blend_corners, space, one.waypoints, BLEND_LENGTH)
        blends.append(replace(one, waypoints=path, length=float(polyline.path_length(path))))
        blend_times.append(elapsed)
        times.append(_timed(follow_path, path, AT_REST, limits, limits.speed)[1])
    yield _row(robot, name="blends", space=space, plans=blends, times=blend_times, lengths=lengths)
    yield _row(robot, name="trajectory", space=space, plans=blends, times=times, lengths=lengths)


def _reference_row(robot: str, point: FreeSpace, queries: list[Query]) -> PlanRow:
    times = [query.reference_ms for query in queries]
    lengths = [query.length for query in queries]
    plans = [
        Plan(
            query.reference,
            cost=0.0,
            length=query.length,
            least_clearance=0.0,
            iterations=1,
            label="none",
        )
        for query in queries
    ]
    return _row(robot, name="reference", space=point, plans=plans, times=times, lengths=lengths)
