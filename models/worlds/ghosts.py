"""A hall in which things appear and vanish, which leaves ghosts in a map."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds.generator import generated
from wayproof.models.worlds.layout import LOW, Point, between, opposite_ends, room
from wayproof.models.worlds.movers import Mover
from wayproof.models.worlds.solids import Box
from wayproof.models.worlds.world import World

SIZE = (16.0, 9.0)
END_DISTANCE = 1.4
"""Distance of start and goal from the outside of the walls, m."""

END_CLEARANCE = 1.9
"""Minimum distance of a thing's middle from start and goal, m."""

THINGS = (2, 12)
"""Number of things at difficulty 0 and 1."""

STAYS = (3.0, 12.0)
"""Shortest and longest time that one exists, s."""

LAST_APPEARANCE = 14.0
"""Latest time at which a thing appears, s."""


@generated
def ghosts(rng: np.random.Generator, difficulty: float, parameters: WorldParameters) -> World:
    """Draw a 16 x 9 m hall with panels about the straight line from end to end.

    Difficulty raises their number from 2 to 12. Each stands still as long as it exists, 3 to 12 s,
    and none appears within half a metre of a robot.
    """
    ends = opposite_ends(rng, SIZE, inset=END_DISTANCE, side_inset=2.5)
    hall, count = room(rng, SIZE, ends), round(between(THINGS, difficulty))
    return replace(hall, movers=tuple(_thing(rng, number, ends) for number in range(count)))


def _thing(rng: np.random.Generator, number: int, line: tuple[Point, Point]) -> Mover:
    """Draw one that stands about the line between two points; every other one is there at first."""
    ends = np.array(line)
    while True:
        middle = ends[0] + rng.uniform(0.1, 0.9) * (ends[1] - ends[0])
        middle[1] = np.clip(middle[1] + rng.normal(0.0, 1.5), LOW[1] + 1.0, SIZE[1] - 1.0)
        if np.linalg.norm(ends - middle, axis=1).min() >= END_CLEARANCE:
            break
    half_z = round(rng.uniform(0.5, 1.3), 3)
    half = (round(rng.uniform(0.1, 0.3), 3), round(rng.uniform(0.3, 0.9), 3), half_z)
    yaw = round(rng.uniform(-1.0, 1.0), 3)
    appears = 0.0 if number % 2 else round(rng.uniform(1.0, LAST_APPEARANCE), 1)
    x, y = np.round(middle, 3).tolist()
    return Mover(
        f"ghost_{number}",
        (Box((0.0, 0.0, half_z), half, yaw, "ghost"),),
        ((x, y, 0.0),),
        appears=appears,
        vanishes=round(appears + rng.uniform(*STAYS), 1),
    )
