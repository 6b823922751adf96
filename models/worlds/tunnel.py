"""A straight bare tunnel: beams along it hold no position while its ends are out of range."""

from __future__ import annotations

import numpy as np

from wayproof.models.arrays import Vector3
from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds.generator import generated
from wayproof.models.worlds.layout import WALL_THICKNESS, heading_towards, mirrored, room_walls
from wayproof.models.worlds.world import World

LENGTH, WIDTH = 30.0, 2.2
"""Between the walls, m."""

END_DISTANCE = 1.1
"""Distance of start and goal from the end walls, m."""

OFFSET = 0.15
"""Greatest distance of start and goal from the middle line, m."""


@generated
def tunnel(
    rng: np.random.Generator, seed: int, difficulty: float, parameters: WorldParameters
) -> World:
    """Draw a tunnel 2.2 m wide and 30 m long without anything in it, at any difficulty."""
    middle = WALL_THICKNESS + WIDTH / 2
    low: Vector3 = (0.0, 0.0, -0.5)
    length, width = (one + 2 * WALL_THICKNESS for one in (LENGTH, WIDTH))
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
