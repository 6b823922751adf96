"""Square halls of any side, which one rule makes."""

from __future__ import annotations

import numpy as np

from wayproof.models.arrays import Vector3
from wayproof.models.worlds import Box, World
from wayproof.models.worlds.layout import WALL_HEIGHT, WALL_THICKNESS, room_walls

FLOOR_PER_SOLID = 65.0
"""Floor for each solid, m^2: 110 of them in 120 x 60 m."""

GAP = 1.7
"""Least gap between solids, m, so that every body passes everywhere."""

RACKS = 5
"""Number of solids of which one is a rack."""

END_INSET = 2.0
"""Distance of start and goal from the walls, m."""


def make_hall(side: float, seed: int) -> World:
    """Make a square hall with racks, crates and pillars, as many by area as in any other."""
    rng = np.random.default_rng([seed, round(side)])
    low: Vector3 = (0.0, 0.0, -0.5)
    start = END_INSET, 0.25 * side, 0.0
    goal = side - END_INSET, 0.75 * side, 0.0
    count = round(side * side / FLOOR_PER_SOLID)
    return World(
        name="hall",
        seed=seed,
        low=low,
        high=(side, side, 3.0),
        solids=(*room_walls(low, (side, side, 3.0)), *_solids(rng, side, count, (start, goal))),
        start=start,
        start_heading=0.0,
        goal=goal,
    )


def _solids(
    rng: np.random.Generator, side: float, count: int, ends: tuple[Vector3, Vector3]
) -> list[Box]:
    """Draw axis-aligned boxes that keep a gap from one another, the walls and the ends."""
    boxes: list[Box] = []
    taken = np.array([(x - 0.5, y - 0.5, x + 0.5, y + 0.5) for x, y, _ in ends])  # (n, 4)
    edge = WALL_THICKNESS + GAP
    while len(boxes) < count:
        if len(boxes) % RACKS == 0:
            extent = rng.uniform(4.0, min(12.0, side / 3.0)), 1.1
            height = rng.uniform(2.0, WALL_HEIGHT)
        else:
            extent = rng.uniform(0.3, 1.5), rng.uniform(0.3, 1.5)
            height = rng.uniform(0.4, WALL_HEIGHT)
        size = np.array(extent if rng.integers(2) else extent[::-1])
        corner = rng.uniform(edge, side - edge - size)
        box = np.concatenate([corner, corner + size])
        apart = np.maximum(taken[:, :2] - box[2:], box[:2] - taken[:, 2:]).max(axis=1)
        if apart.min() < GAP:
            continue
        taken = np.vstack([taken, box])
        boxes.append(Box.between((*box[:2].tolist(), 0.0), (*box[2:].tolist(), height), "crate"))
    return boxes
