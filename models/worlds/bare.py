"""Bare rooms: one to cost a stack without obstacles, one too wide to see, one too long."""

from __future__ import annotations

import numpy as np

from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds.generator import generated
from wayproof.models.worlds.layout import (
    WALL_THICKNESS,
    Point,
    mirrored,
    points_apart,
    room,
)
from wayproof.models.worlds.world import World

TUNNEL = (30.0, 2.2)
"""Length and width of the tunnel between the walls, m."""

TUNNEL_END = 1.1
"""Distance of its start and goal from the end walls, m."""

TUNNEL_OFFSET = 0.15
"""Greatest distance of its start and goal from the middle line, m."""


@generated
def empty(rng: np.random.Generator, difficulty: float, parameters: WorldParameters) -> World:
    """Draw a room of 12 x 12 m, start and goal at least 6 m apart, at any difficulty."""
    size = (parameters.empty.length, parameters.empty.width)
    return _bare(rng, size, inset=1.2, least=6.0)


@generated
def hall(rng: np.random.Generator, difficulty: float, parameters: WorldParameters) -> World:
    """Draw a hall 46 x 32 m, start and goal 10 m apart and 13.8 m from its walls.

    A sensor of 12 m sees nothing but its floor on the way.
    """
    return _bare(rng, (46.0, 32.0), inset=WALL_THICKNESS + 13.8, least=10.0)


@generated
def tunnel(rng: np.random.Generator, difficulty: float, parameters: WorldParameters) -> World:
    """Draw a tunnel 2.2 m wide and 30 m long without anything in it, at any difficulty.

    Beams along it hold no position while its ends are out of range.
    """
    middle = WALL_THICKNESS + TUNNEL[1] / 2
    length, width = (round(one + 2 * WALL_THICKNESS, 3) for one in TUNNEL)
    y_start, y_goal = np.round(middle + rng.uniform(-TUNNEL_OFFSET, TUNNEL_OFFSET, 2), 3).tolist()
    start = (WALL_THICKNESS + TUNNEL_END, y_start)
    goal = (round(length - WALL_THICKNESS - TUNNEL_END, 3), y_goal)
    return mirrored(rng, room(rng, (length, width), (start, goal)))


def _bare(rng: np.random.Generator, size: Point, inset: float, least: float) -> World:
    """Draw start and goal at least so far apart, `inset` from the outside of the walls, m."""
    return room(rng, size, points_apart(rng, np.full(2, inset), np.subtract(size, inset), least))
