"""A bent corridor with a few crates and little room to turn."""

from __future__ import annotations

import numpy as np

from wayproof.models.arrays import Vector3
from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds.generator import generated
from wayproof.models.worlds.layout import (
    WALL_HEIGHT,
    WALL_THICKNESS,
    given_or,
    heading_towards,
    mirrored,
    room_walls,
    with_crates,
)
from wayproof.models.worlds.solids import Box
from wayproof.models.worlds.world import World

LENGTH = 16.0
"""Length of the centre line from end wall to end wall, m."""

END_DISTANCE = 1.1
"""Distance of start and goal from the end walls, m."""


@generated
def corridor(
    rng: np.random.Generator, seed: int, difficulty: float, parameters: WorldParameters
) -> World:
    """Draw a corridor 2.0-2.4 m wide and 16 m long with one or two bends.

    Difficulty scales the number of crates: 2 to 4 at 0.5.
    """
    own = parameters.corridor
    width = given_or(own.width, rng.uniform(2.0, 2.4))
    shell = (_one_bend if rng.uniform() < 0.5 else _two_bends)(rng, seed, width)
    count = given_or(own.crates, round(2 * difficulty * int(rng.integers(2, 5))))
    furnished = with_crates(rng, shell, count, longest=0.6, radius=parameters.passage_radius)
    return mirrored(furnished, flip_x=bool(rng.integers(2)), flip_y=bool(rng.integers(2)))


def _one_bend(rng: np.random.Generator, seed: int, width: float) -> World:
    """Build a corridor east, then north: a rectangular room less one solid block."""
    first = rng.uniform(6.0, 10.0)
    inner = WALL_THICKNESS
    east, north = inner + first + width / 2, inner + LENGTH - first + width / 2
    blocks = [_block((inner, inner + width), (east - width, north))]
    start, goal = (
        (inner + END_DISTANCE, inner + width / 2),
        (east - width / 2, north - END_DISTANCE),
    )
    return _shell(rng, seed, (east, north), blocks, start, goal)


def _two_bends(rng: np.random.Generator, seed: int, width: float) -> World:
    """Build a corridor east, north and east again: a room less two solid blocks."""
    first, second = (rng.uniform(*limits) for limits in ((4.5, 6.5), (4.0, 5.0)))
    inner = WALL_THICKNESS
    corner_x, corner_y = inner + first, inner + width / 2 + second  # of the centre line
    east, north = corner_x + LENGTH - first - second, corner_y + width / 2
    blocks = [
        _block((inner, inner + width), (corner_x - width / 2, north)),
        _block((corner_x + width / 2, inner), (east, north - width)),
    ]
    return _shell(
        rng,
        seed,
        (east, north),
        blocks,
        (inner + END_DISTANCE, inner + width / 2),
        (east - END_DISTANCE, corner_y),
    )


def _block(low: tuple[float, float], high: tuple[float, float]) -> Box:
    return Box.between((*low, 0.0), (*high, WALL_HEIGHT), "partition")


def _shell(
    rng: np.random.Generator,
    seed: int,
    inside: tuple[float, float],
    blocks: list[Box],
    start: tuple[float, float],
    goal: tuple[float, float],
) -> World:
    low: Vector3 = (0.0, 0.0, -0.5)
    high = (round(inside[0] + WALL_THICKNESS, 3), round(inside[1] + WALL_THICKNESS, 3), 3.0)
    return World(
        name="corridor",
        seed=seed,
        low=low,
        high=high,
        solids=(*room_walls(low, high), *blocks),
        start=(round(start[0], 3), round(start[1], 3), 0.0),
        start_heading=heading_towards(rng, start, (start[0] + 1.0, start[1])),
        goal=(round(goal[0], 3), round(goal[1], 3), 0.0),
    )
