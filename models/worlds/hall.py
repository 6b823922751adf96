"""A bare hall so wide that a sensor of 12 m sees nothing but its floor on the way."""

from __future__ import annotations

import numpy as np

from wayproof.models.arrays import Vector3
from wayproof.models.world_parameters import Hall
from wayproof.models.worlds.layout import WALL_THICKNESS, heading_towards, points_apart, room_walls
from wayproof.models.worlds.solvability import first_solvable
from wayproof.models.worlds.world import World

LEAST_DISTANCE = 10.0
"""Least distance of start and goal, m."""


def hall(
    seed: int,
    difficulty: float = 0.5,
    parameters: Hall = Hall(),  # noqa: B008  # frozen
) -> World:
    """Generate a hall 46 x 32 m, start and goal 10 m apart and 13.8 m from its walls.

    Raises:
        ValueError: The seed is negative, or the difficulty not from 0 to 1.
    """
    return first_solvable(
        "hall",
        seed,
        lambda rng: _draft(rng, seed, parameters),
        difficulty,
        parameters.passage_radius,
    )


def _draft(rng: np.random.Generator, seed: int, parameters: Hall) -> World:
    low: Vector3 = (0.0, 0.0, -0.5)
    high = (parameters.length, parameters.width, 3.0)
    inner = np.full(2, WALL_THICKNESS + parameters.wall_distance)
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
