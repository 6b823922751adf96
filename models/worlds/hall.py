"""A bare hall so wide that a sensor of 12 m sees nothing but its floor on the way."""

from __future__ import annotations

import numpy as np

from wayproof.models.arrays import Vector3
from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds.generator import generated
from wayproof.models.worlds.layout import WALL_THICKNESS, heading_towards, points_apart, room_walls
from wayproof.models.worlds.world import World

LENGTH, WIDTH = 46.0, 32.0
WALL_DISTANCE = 13.8
"""Least distance of start and goal from the walls, m."""

LEAST_DISTANCE = 10.0
"""Least distance of start and goal, m."""


@generated
def hall(
    rng: np.random.Generator, seed: int, difficulty: float, parameters: WorldParameters
) -> World:
    """Draw a hall 46 x 32 m, start and goal 10 m apart and 13.8 m from its walls."""
    low: Vector3 = (0.0, 0.0, -0.5)
    high = (LENGTH, WIDTH, 3.0)
    inner = np.full(2, WALL_THICKNESS + WALL_DISTANCE)
    start, goal = points_apart(rng, inner, high[:2] - inner, LEAST_DISTANCE)
    return World(
        name="hall",
        seed=seed,
        low=low,
        high=high,
        solids=room_walls(low, high),
        start=(*start, 0.0),
        start_heading=heading_towards(rng, start, goal),
        goal=(*goal, 0.0),
    )
