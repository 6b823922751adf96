"""Goals of a config as points; names of places are resolved to points of the world."""

from __future__ import annotations

from itertools import pairwise

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.models.robots import RobotSpec
from wayproof.models.world_files import FileWorld
from wayproof.models.worlds import World
from wayproof.models.worlds.aisle import aisle_places
from wayproof.models.worlds.solvability import RESOLUTION, cell_of, free_cells, label_regions

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
