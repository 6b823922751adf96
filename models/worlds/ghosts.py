"""A hall in which things appear and vanish: what a map keeps of them are ghosts."""

from __future__ import annotations

import numpy as np

from wayproof.models.arrays import Vector3
from wayproof.models.worlds.layout import heading_towards, room_walls
from wayproof.models.worlds.movers import Mover
from wayproof.models.worlds.solids import Box
from wayproof.models.worlds.solvability import first_solvable
from wayproof.models.worlds.world import World

LOW: Vector3 = (0.0, 0.0, -0.5)
HIGH: Vector3 = (16.0, 9.0, 3.0)
END = 1.4
"""Start and goal keep this from the outside of the walls, m."""

CLEAR = 1.9
"""No thing appears nearer to start or goal than this, from its middle, m."""

THINGS = (2, 12)
STAYS = (3.0, 12.0)
"""Least and greatest, s; half of the things are there from the beginning."""

LAST = 14.0
"""No thing appears later, s."""


def ghosts(seed: int, difficulty: float = 0.5) -> World:
    """A 16 x 9 m hall, start and goal at its two ends, panels about the straight line between.

    Difficulty raises their number from 2 to 12. Each stands still as long as it exists, 3 to 12 s,
    and none appears within half a metre of a robot.

    Raises:
        ValueError: The seed is negative, or the difficulty not from 0 to 1.
    """
    return first_solvable("ghosts", seed, lambda rng: _draft(rng, seed, difficulty), difficulty)


def _draft(rng: np.random.Generator, seed: int, difficulty: float) -> World:
    start, goal = (
        (x, round(rng.uniform(LOW[1] + 2.5, HIGH[1] - 2.5), 3), 0.0) for x in (END, HIGH[0] - END)
    )
    count = round(THINGS[0] + difficulty * (THINGS[1] - THINGS[0]))
    return World(
        name="ghosts",
        seed=seed,
        low=LOW,
        high=HIGH,
        solids=room_walls(LOW, HIGH),
        start=start,
        start_heading=heading_towards(rng, start, goal),
        goal=goal,
        movers=tuple(_thing(rng, number, start, goal) for number in range(count)),
    )


def _thing(rng: np.random.Generator, number: int, start: Vector3, goal: Vector3) -> Mover:
    ends = np.array([start[:2], goal[:2]])
    while True:
        middle = ends[0] + rng.uniform(0.1, 0.9) * (ends[1] - ends[0])
        middle[1] = np.clip(middle[1] + rng.normal(0.0, 1.5), LOW[1] + 1.0, HIGH[1] - 1.0)
        if np.linalg.norm(ends - middle, axis=1).min() >= CLEAR:
            break
    half_z = round(rng.uniform(0.5, 1.3), 3)
    half = (round(rng.uniform(0.1, 0.3), 3), round(rng.uniform(0.3, 0.9), 3), half_z)
    yaw = round(rng.uniform(-1.0, 1.0), 3)
    appears = 0.0 if number % 2 else round(rng.uniform(1.0, LAST), 1)
    x, y = np.round(middle, 3).tolist()
    return Mover(
        f"ghost_{number}",
        (Box((0.0, 0.0, half_z), half, yaw, "ghost"),),
        ((x, y, 0.0),),
        appears=appears,
        vanishes=round(appears + rng.uniform(*STAYS), 1),
    )
