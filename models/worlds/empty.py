"""An empty square room, to measure what a stack costs without obstacles."""

from __future__ import annotations

import numpy as np

from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds.generator import generated
from wayproof.models.worlds.layout import heading_towards, points_apart, room_walls
from wayproof.models.worlds.world import World

LEAST_DISTANCE = 6.0
END_DISTANCE = 1.2
"""Distance of start and goal from the outside of the walls, m: 1 m from their inside."""


@generated
def empty(
    rng: np.random.Generator, seed: int, difficulty: float, parameters: WorldParameters
) -> World:
    """Draw a room of 12 x 12 m, start and goal at least 6 m apart, at any difficulty."""
    low, high = (0.0, 0.0, -0.5), (parameters.empty.length, parameters.empty.width, 3.0)
    inner = np.full(2, END_DISTANCE)
    start, goal = points_apart(rng, inner, high[:2] - inner, LEAST_DISTANCE)
    return World(
        name="empty",
        seed=seed,
        low=low,
        high=high,
        solids=room_walls(low, high),
        start=(*start, 0.0),
        start_heading=heading_towards(rng, start, goal),
        goal=(*goal, 0.0),
    )
