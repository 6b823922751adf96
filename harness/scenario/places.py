"""Goals of a config as points, and the shortest ways in truth between them, for scoring."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.models.robots import RobotSpec
from wayproof.models.world_files import FileWorld
from wayproof.models.worlds import World, shortest_path_length
from wayproof.models.worlds.aisle import aisle_places
from wayproof.models.worlds.solids import Band
from wayproof.models.worlds.solvability import RESOLUTION, cell_of, free_cells, label_regions
from wayproof.planners import FreeSpace, PlannerConfig, plan

Given = tuple[float, ...]
"""A point as given: x, y or x, y, z, m."""

Point = tuple[float, float, float]


def goals_of(config: Config, world: World) -> tuple[Given, ...]:
    """Return the goals of a config in their order.

    Args:
        config: Config with goals as points or by the names in `models.places.PLACES`.
        world: World of the episode.

    Raises:
        InputError: The world has no such place.
    """
    start = world.start[:2] if config.start is None else config.start
    goals: list[Given] = []
    for goal in (*config.waypoints, "world" if config.goal is None else config.goal):
        if not isinstance(goal, str):
            goals.append(goal)
        elif goal == "home":
            goals.append(start)
        elif goal == "world":
            goals.append(world.goal[:2])
        else:
            goals += _aisle(world, goals[-1] if goals else start)
    return tuple(goals)


def _aisle(world: World, before: Given) -> tuple[Given, ...]:
    try:
        return aisle_places(world, before)
    except ValueError as error:
        raise InputError(f"goal {error}; expected a point, home or world") from None


def refuse_no_way(world: World, spec: RobotSpec, start: Point, goals: tuple[Point, ...]) -> None:
    """Refuse a mission of several goals with a leg that no part of a ground robot could pass.

    A robot that flies is not judged, nor is a world of a file, whose floor may rise. A narrow way
    may still be closed to the whole body, or to its map: the cause of the failure says so.

    Raises:
        InputError: There is no way from one of the goals to the next.
    """
    if len(goals) == 1 or spec.motion != "ground" or isinstance(world, FileWorld):
        return
    thinnest = min((radius for _, radius in spec.discs), default=spec.radius) - RESOLUTION
    labels = label_regions(free_cells(world, thinnest, (spec.step_height, spec.height)))
    for number, (begin, end) in enumerate(pairwise((start, *goals)), 1):
        region = labels[cell_of(world, begin)]
        if not region or region != labels[cell_of(world, end)]:
            x, y = end[:2]
            raise InputError(
                f"goal {number} of {len(goals)}: got ({x:g}, {y:g}), which nothing as wide as this "
                f"robot can reach from ({begin[0]:g}, {begin[1]:g})"
            )


MOST_CELLS = 1_000_000
"""Largest grid whose cells are all searched; it takes 50 bytes for each."""

PLANNER = PlannerConfig(
    iterations=100_000, restarts=1, shortcuts=2000, clearance_weight=0.0, corner_cost=0.0
)
"""Planner in a larger world."""

MOST_SEARCHED = 4_000_000
"""Largest grid that the planner searches, cells; those of a larger world are wider. It takes 66
bytes for each."""

KEPT = 16
"""Number of lengths that a process keeps."""

SEED = 1
"""Seed of the shortcuts: a world has one length."""


def route_between(
    world: World, radius: float, band: Band, begin: Point, end: Point
) -> float | None:
    """Return the length of the shortest way of an upright cylinder past all solids, m; maybe None.

    Args:
        world: Truth.
        radius: Radius of the cylinder, m.
        band: Heights that it takes up, m.
        begin: Start of the way, m; z is ignored.
        end: End of the way, m.
    """
    extent = np.subtract(world.high[:2], world.low[:2])
    cells = math.prod(np.rint(extent / RESOLUTION).tolist())
    if cells <= MOST_CELLS:
        return shortest_path_length(world, radius, band, begin, end)
    wide = math.ceil(math.sqrt(cells / MOST_SEARCHED))
    field = _all_free(free_cells(world, radius, band), wide).astype(np.uint16)[:, :, None]
    size = wide * RESOLUTION
    origin = np.array([*world.low[:2], -0.5 * size])
    space = FreeSpace(
        field, origin, resolution=size, collision_distance_sq=0, cost_by_distance=np.zeros(2)
    )
    a, b = (np.array([point[0], point[1], 0.0]) for point in (begin, end))
    found = plan(space, a, goal=b, config=PLANNER, seed=SEED)
    return None if found.waypoints is None else found.length


def known_route(world: World, radius: float, band: Band, begin: Point, end: Point) -> float | None:
    """Return what `route_between` does, measured once for an episode, its replays and its arms."""
    try:
        hash(world)
    except TypeError:  # a surface holds arrays
        return route_between(world, radius, band, begin, end)
    return _route_between(world, radius, band, begin, end)


_route_between = lru_cache(maxsize=KEPT)(route_between)


def _all_free(free: NDArray[np.bool_], wide: int) -> NDArray[np.bool_]:
    """Return whether all cells of each square of `wide` by `wide` are free; outside none is."""
    rows, columns = (-n % wide for n in free.shape)
    padded = np.pad(free, ((0, rows), (0, columns)))
    squares = padded.reshape(padded.shape[0] // wide, wide, padded.shape[1] // wide, wide)
    return np.asarray(squares.all(axis=(1, 3)))
