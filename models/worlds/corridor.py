"""A bent corridor with a few crates and little room to turn."""

from __future__ import annotations

import numpy as np

from wayproof.models.arrays import Vector3
from wayproof.models.world_parameters import Corridor
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
from wayproof.models.worlds.solvability import first_solvable
from wayproof.models.worlds.world import World

DRAWN_LENGTH = 16.0
"""Length of the centre line for which the places of the bends are drawn, m."""

END_DISTANCE = 1.1
"""Distance of start and goal from the end walls, m."""


def corridor(
    seed: int,
    difficulty: float = 0.5,
    parameters: Corridor = Corridor(),  # noqa: B008  # frozen
) -> World:
    """Generate a corridor 2.0-2.4 m wide and 16 m long with one or two bends.

    Difficulty scales the number of crates: 2 to 4 at 0.5.

    Raises:
        ValueError: The seed is negative, or the difficulty not from 0 to 1.
        RuntimeError: No draft let the reference bodies through.
    """
    return first_solvable(
        "corridor",
        seed,
        lambda rng: _draft(rng, seed, difficulty, parameters),
        difficulty,
        parameters.passage_radius,
    )


def _draft(rng: np.random.Generator, seed: int, difficulty: float, parameters: Corridor) -> World:
    width, length = given_or(parameters.width, rng.uniform(2.0, 2.4)), parameters.length
    bends = given_or(parameters.bends, 1 if rng.uniform() < 0.5 else 2)
    shell = (_one_bend if bends == 1 else _two_bends)(rng, seed, width, length)
    count = given_or(parameters.crates, round(2 * difficulty * int(rng.integers(2, 5))))
    furnished = with_crates(rng, shell, count, longest=0.6, radius=parameters.passage_radius)
    return mirrored(furnished, flip_x=bool(rng.integers(2)), flip_y=bool(rng.integers(2)))


def _one_bend(rng: np.random.Generator, seed: int, width: float, length: float) -> World:
    """Build a corridor east, then north: a rectangular room less one solid block."""
    first = rng.uniform(6.0, 10.0) * (length / DRAWN_LENGTH)
    inner = WALL_THICKNESS
    east, north = inner + first + width / 2, inner + length - first + width / 2
    blocks = [_block((inner, inner + width), (east - width, north))]
    start, goal = (
        (inner + END_DISTANCE, inner + width / 2),
        (east - width / 2, north - END_DISTANCE),
    )
    return _shell(rng, seed, (east, north), blocks, start, goal)


def _two_bends(rng: np.random.Generator, seed: int, width: float, length: float) -> World:
    """Build a corridor east, north and east again: a room less two solid blocks."""
    first, second = (
        rng.uniform(*limits) * (length / DRAWN_LENGTH) for limits in ((4.5, 6.5), (4.0, 5.0))
    )
    inner = WALL_THICKNESS
    corner_x, corner_y = inner + first, inner + width / 2 + second  # of the centre line
    east, north = corner_x + length - first - second, corner_y + width / 2
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
