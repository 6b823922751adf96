"""`wayproof bench plan`: paths of 14 to 16 m across a warehouse at 5 cm, for both robots.

All planners solve the same queries in the same run, with clearance weight 0 and no price of
corners, and a path's length is compared with the shortest that any of them found for its query.
Times are processor time of one thread.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace
from statistics import median
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from wayproof.harness.bench.table import Progress, Row
from wayproof.maps import collision_distance_sq
from wayproof.planners import (
    PLANNERS,
    Body,
    FreeSpace,
    Plan,
    PlannerConfig,
    plan,
    plan_seed,
    warm_up,
)

Array = NDArray[np.float64]

RESOLUTION = 0.05  # m
SIZE = (20.0, 20.0, 3.0)  # m
REACH = 30  # cells, greatest distance of the field
MARGIN = 0.05  # m, localization
DRONE = Body((0.0,), (0.3,))
QUADRUPED = Body((-0.2, 0.0, 0.2), (0.2, 0.2, 0.2))
BAND = (0.1, 0.6)  # m above the floor, that the quadruped passes
COST_SCALE = 4.0  # per m, of Nav2's law exp(-scale (distance - forbidden))


class Query(NamedTuple):
    """Two free points (3,), m, the heading at the start, rad, and the seed of the search."""

    start: Array
    goal: Array
    heading: float
    seed: int


def bench_plan(repeats: int, seed: int, progress: Progress) -> list[Row]:
    """Time every planner on seeded queries, `repeats` of them; one row for each.

    A row has the `robot` in whose space was planned; the `planner`; `success`, the share of queries
    with a path; the least, the median and the 99th percentile of the processor time of a plan,
    `ms_min`, `ms` and `ms_p99`; `x_astar`, its median over that of `astar`; `length` and
    `length_p99`, the mean and 99th percentile of the path's length over the shortest one found.
    `astar, clear` plans with the default weights of clearance and corners: its paths are longer.
    """
    warm_up()
    blocked = warehouse(seed)
    rows: list[Row] = []
    for robot, space in (("drone", air(blocked)), ("quadruped", ground(blocked))):
        queries = make_queries(space, repeats, seed)
        found: dict[str, list[tuple[Plan, float]]] = {}
        for number, query in enumerate(queries):
            progress(f"plan: {robot}, {number} of {len(queries)} queries")
            for name in PLANNERS:
                short = PlannerConfig(name=name, clearance_weight=0.0, corner_cost=0.0)
                found.setdefault(name, []).append(_timed(_plan, space, query, short))
            clear = _timed(_plan, space, query, PlannerConfig(name="astar"))
            found.setdefault("astar, clear", []).append(clear)
        rows += _rows(robot, found)
    return rows


def _plan(space: FreeSpace, query: Query, config: PlannerConfig) -> Plan:
    return plan(space, query.start, query.goal, config, query.seed, query.heading)


def _timed(work: Callable[..., Plan], *given: object) -> tuple[Plan, float]:
    """Return a plan, and its processor time, ms."""
    began = time.process_time()
    found = work(*given)
    return found, 1e3 * (time.process_time() - began)


def _rows(robot: str, found: dict[str, list[tuple[Plan, float]]]) -> list[Row]:
    lengths = {
        name: np.array([one.length if one.waypoints is not None else math.inf for one, _ in plans])
        for name, plans in found.items()
    }
    shortest = np.min(list(lengths.values()), axis=0)
    peer = median(ms for _, ms in found["astar"])
    rows = []
    for name, plans in found.items():
        times = [ms for _, ms in plans]
        solved = np.isfinite(lengths[name])
        ratios = lengths[name][solved] / shortest[solved] if solved.any() else np.array([math.inf])
        rows.append({
            "robot": robot,
            "planner": name,
            "success": float(solved.mean()),
            "ms_min": min(times),
            "ms": median(times),
            "ms_p99": float(np.percentile(times, 99)),
            "x_astar": median(times) / peer,
            "length": float(ratios.mean()),
            "length_p99": float(np.percentile(ratios, 99)),
        })  # fmt: skip
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


def air(blocked: NDArray[np.bool_]) -> FreeSpace:
    """Return the drone's space: a ball in three dimensions."""
    return _space(blocked, DRONE, flat=False)


def ground(blocked: NDArray[np.bool_]) -> FreeSpace:
    """Return the quadruped's space: discs in the plane."""
    low, high = (round(height / RESOLUTION) for height in BAND)
    columns = np.asarray(blocked[:, :, low:high].any(axis=2))  # (nx, ny)
    return _space(columns[:, :, None], QUADRUPED, flat=True)


def _space(blocked: NDArray[np.bool_], body: Body, flat: bool) -> FreeSpace:
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
        return point
    return replace(point, discs=body.discs(MARGIN, RESOLUTION, flat))


def squared_distances(blocked: NDArray[np.bool_]) -> NDArray[np.uint16]:
    """Return the squared distance in cells to the nearest blocked one, at most the reach's."""
    squared = np.rint(distance_transform_edt(~blocked) ** 2)
    cells: NDArray[np.uint16] = np.minimum(squared, REACH * REACH).astype(np.uint16)
    return cells


def make_queries(space: FreeSpace, count: int, seed: int) -> list[Query]:
    """Draw pairs of free points 14 to 16 m apart that `astar` finds a path between."""
    rng = np.random.default_rng([seed, space.distances.shape[2]])
    queries: list[Query] = []
    while len(queries) < count:
        start, goal = (_random_point(rng, space) for _ in range(2))
        heading = math.pi * rng.uniform(-1.0, 1.0)
        # A body of discs has to fit at the goal at some heading: here, at any.
        poses = [(start, heading), *((goal, turn) for turn in np.arange(16) / 2.5)]
        if not 14.0 <= math.dist(start, goal) <= 16.0 or not all(
            space.sweep_free(pose, pose) for pose in (np.append(*one) for one in poses)
        ):
            continue
        query = Query(start, goal, heading, plan_seed(seed, "bench", len(queries)))
        if _plan(space, query, PlannerConfig(name="astar")).waypoints is not None:
            queries.append(query)
    return queries


def _random_point(rng: np.random.Generator, space: FreeSpace) -> Array:
    extent = np.array(space.distances.shape) * space.resolution
    point = rng.uniform(0.0, extent)
    if space.flat:
        point[2] = 0.5 * extent[2]
    return point
