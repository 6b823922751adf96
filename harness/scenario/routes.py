"""Shortest ways in truth, for scoring: by Dijkstra on a grid, or by A* where that is large."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from wayproof.models.worlds import World, shortest_path_length
from wayproof.models.worlds.solids import Band
from wayproof.models.worlds.solvability import RESOLUTION, free_cells
from wayproof.planners import FreeSpace, PlannerConfig, plan

Point = tuple[float, float, float]

MOST_CELLS = 1_000_000
"""Largest grid whose cells are all searched; it takes 230 bytes for each."""

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
        return shortest_path_length(world, radius, *band, begin, end)
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
