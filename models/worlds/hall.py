"""A bare hall so wide that a sensor of 12 m sees nothing but its floor on the way."""

from __future__ import annotations

import numpy as np

from wayproof.models.arrays import Vector3
from wayproof.models.worlds.layout import heading_towards, room_walls
from wayproof.models.worlds.solvability import first_solvable
from wayproof.models.worlds.world import World

LENGTH, WIDTH = 46.0, 32.0
"""Of the outside of the walls, m."""

OUT_OF_RANGE = 14.0
"""Distance of start and goal from the outside of the walls, m."""

LEAST_DISTANCE = 10.0
"""Of start and goal, m."""


def hall(seed: int, difficulty: float = 0.5) -> World:
    """Generate a hall 46 x 32 m, the way of 10 m and more 13 m from its walls, at any difficulty.

    Raises:
        ValueError: The seed is negative, or the difficulty not from 0 to 1.
    """
    return first_solvable("hall", seed, lambda rng: _draft(rng, seed), difficulty)


def _draft(rng: np.random.Generator, seed: int) -> World:
    low: Vector3 = (0.0, 0.0, -0.5)
    high = (LENGTH, WIDTH, 3.0)
    inner = np.array([OUT_OF_RANGE, OUT_OF_RANGE])
    while True:
        start, goal = np.round(rng.uniform(inner, high[:2] - inner, (2, 2)), 3).tolist()
        if np.hypot(goal[0] - start[0], goal[1] - start[1]) >= LEAST_DISTANCE:
            break
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
