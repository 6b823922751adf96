"""A straight bare tunnel: beams along it hold no position while its ends are out of range."""

from __future__ import annotations

import numpy as np

from wayproof.models.arrays import Vector3
from wayproof.models.world_parameters import Tunnel
from wayproof.models.worlds.layout import WALL_THICKNESS, heading_towards, mirrored, room_walls
from wayproof.models.worlds.solvability import first_solvable
from wayproof.models.worlds.world import World

END_DISTANCE = 1.1
"""Distance of start and goal from the end walls, m."""

OFFSET = 0.15
"""Greatest distance of start and goal from the middle line, m."""


def tunnel(
    seed: int,
    difficulty: float = 0.5,
    parameters: Tunnel = Tunnel(),  # noqa: B008  # frozen
) -> World:
    """Generate a tunnel 2.2 m wide and 30 m long without anything in it, at any difficulty.

    Raises:
        ValueError: The seed is negative, or the difficulty not from 0 to 1.
    """
    return first_solvable(
        "tunnel",
        seed,
        lambda rng: _draft(rng, seed, parameters),
        difficulty,
        parameters.passage_radius,
    )


def _draft(rng: np.random.Generator, seed: int, parameters: Tunnel) -> World:
    middle = WALL_THICKNESS + parameters.width / 2
    low: Vector3 = (0.0, 0.0, -0.5)
    length, width = (one + 2 * WALL_THICKNESS for one in (parameters.length, parameters.width))
    high = (round(length, 3), round(width, 3), 3.0)
    sides = np.round(middle + rng.uniform(-OFFSET, OFFSET, 2), 3).tolist()
    start = (WALL_THICKNESS + END_DISTANCE, sides[0])
    goal = (round(high[0] - WALL_THICKNESS - END_DISTANCE, 3), sides[1])
    world = World(
        name="tunnel",
        seed=seed,
        low=low,
        high=high,
        solids=room_walls(low, high),
        start=(*start, 0.0),
        start_heading=heading_towards(rng, start, goal),
        goal=(*goal, 0.0),
    )
    return mirrored(world, flip_x=bool(rng.integers(2)), flip_y=bool(rng.integers(2)))
