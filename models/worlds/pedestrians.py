"""Pedestrians and vehicles that cross the way through a world."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.worlds.movers import STAND_OFF, Mover
from wayproof.models.worlds.solids import Box, Capsule, Solid
from wayproof.models.worlds.solvability import (
    GROUND_BAND,
    RESOLUTION,
    cell_of,
    free_cells,
    passage_radius,
    shortest_path,
)
from wayproof.models.worlds.world import World

PERSON: tuple[Solid, ...] = (Capsule((0.0, 0.0, 0.25), (0.0, 0.0, 1.5), 0.25, "person"),)
"""Solids of a person, 1.75 m high and 0.5 m wide."""

FORKLIFT: tuple[Solid, ...] = (
    Box.between((-0.9, -0.5, 0.05), (0.5, 0.5, 1.1), "vehicle"),
    Box.between((0.5, -0.45, 0.05), (0.6, 0.45, 2.1), "vehicle"),
    Box.between((0.6, -0.35, 0.05), (1.4, -0.2, 0.12), "vehicle"),
    Box.between((0.6, 0.2, 0.05), (1.4, 0.35, 0.12), "vehicle"),
)
"""Solids of a forklift: body, mast and two forks just above the floor."""

PERSON_BAND = (0.03, 1.75)
WALK_CLEARANCE = 0.35
"""Radius that is free along a person's way, m."""

SHORTEST_WAY, LONGEST_WAY = 2.0, 8.0
"""Length of the way of a passer-by, m."""

END_DISTANCE = 1.5
"""Minimum distance of pedestrians from start and goal, m."""

TRIES = 60

NARROWER = (0.6, 0.45, 0.3, 0.2)
"""Radii of discs that are tried where the reference disc has no way, m."""


def with_traffic(
    world: World, count: int, speed: float, seed: int, stands_off: float = STAND_OFF
) -> World:
    """Add up to `count` people that walk to and fro across the shortest way.

    Args:
        world: World to be peopled; what moves in it stays.
        count: Number of people; those without a free line of 2 m across are left out.
        speed: m/s, the same for all.
        seed: Seed of their ways.
        stands_off: See `Mover`; 0 for people that do not stop.

    Raises:
        ValueError: A negative count or speed, or no way from start to goal.
    """
    if count < 0 or not speed >= 0.0:
        raise ValueError(f"count, speed: got {count} and {speed}, expected 0 or more")
    rng = np.random.default_rng([seed, *b"traffic"])
    way = _widest_way(world)
    if way is None:
        raise ValueError(f"world '{world.name}': no way from start to goal to walk across")
    free = free_cells(world, WALK_CLEARANCE, PERSON_BAND)
    before = sum(mover.name.startswith("passer_by_") for mover in world.movers)
    people: list[Mover] = []
    for _ in range(TRIES * count):
        if len(people) == count:
            break
        route = _crossing(rng, world, free, way)
        name = f"passer_by_{before + len(people)}"
        if route is not None:
            begin = round(float(rng.uniform(0.0, 2.0 * np.linalg.norm(np.subtract(*route)))), 3)
            people.append(Mover(name, PERSON, route, speed, begin, stands_off=stands_off))
    return replace(world, movers=(*world.movers, *people))


def _widest_way(world: World) -> NDArray[np.float64] | None:
    """Return the shortest way for the reference disc, or for one that is less wide."""
    radii = (passage_radius(world.difficulty), *NARROWER)
    for radius in radii:
        way = shortest_path(world, radius, GROUND_BAND, world.start, world.goal)
        if way is not None:
            return way
    return None


def _crossing(
    rng: np.random.Generator, world: World, free: NDArray[np.bool_], way: NDArray[np.float64]
) -> tuple[Vector3, Vector3] | None:
    """Draw a free straight line across a random place of the way, if it is long enough."""
    lengths = np.linalg.norm(np.diff(way, axis=0), axis=1)
    at = rng.uniform(0.15, 0.85) * lengths.sum()
    leg = min(int(np.searchsorted(np.cumsum(lengths), at)), len(lengths) - 1)
    along = (way[leg + 1] - way[leg]) / lengths[leg]
    middle = way[leg] + (at - lengths[:leg].sum()) * along
    turn = np.pi / 2 + rng.uniform(-0.4, 0.4)
    c, s = np.cos(turn), np.sin(turn)
    direction = np.array([c * along[0] - s * along[1], s * along[0] + c * along[1]])
    tail = middle - _reach(world, free, middle, -direction) * direction
    head = middle + _reach(world, free, middle, direction) * direction
    if np.linalg.norm(head - tail) < SHORTEST_WAY:
        return None
    line = tail + np.linspace(0.0, 1.0, 40)[:, None] * (head - tail)
    ends = np.array([world.start[:2], world.goal[:2]])
    if np.linalg.norm(line[:, None] - ends[None], axis=2).min() < END_DISTANCE:
        return None
    (x0, y0), (x1, y1) = np.round([tail, head], 3).tolist()
    return (x0, y0, 0.0), (x1, y1, 0.0)


def _reach(
    world: World, free: NDArray[np.bool_], origin: NDArray[np.float64], beam: NDArray[np.float64]
) -> float:
    """Return the free distance from a point in a direction, m."""
    reach = 0.0
    while reach < LONGEST_WAY / 2:
        point = origin + (reach + RESOLUTION) * beam
        if not ((point > world.low[:2]) & (point < world.high[:2])).all():
            break
        if not free[cell_of(world, point)]:
            break
        reach += RESOLUTION
    return reach
