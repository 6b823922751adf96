"""A hall that people and forklifts cross, from wall to wall, to and fro."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds.generator import generated
from wayproof.models.worlds.layout import between, opposite_ends, room, with_crates
from wayproof.models.worlds.movers import Mover
from wayproof.models.worlds.pedestrians import FORKLIFT, PERSON
from wayproof.models.worlds.world import World

SIZE = (17.0, 11.0)
FORKLIFT_SHARE = 0.25
"""Share of forklifts among the movers."""

END_DISTANCE = 1.4
"""Distance of start and goal from the outside of the walls, m."""

LANE_DISTANCE = 4.2
"""Distance of the first and of the last lane from the ends of the hall, m."""

MOVERS = (2, 8)
SPEEDS = ((0.3, 0.7), (0.7, 1.5))
"""Lowest and highest speed of the movers at difficulty 0 and 1, m/s; people walk at up to 1.5."""


@generated
def crossing(rng: np.random.Generator, difficulty: float, parameters: WorldParameters) -> World:
    """Draw a 17 x 11 m hall, start and goal at its two ends, lanes across between them.

    Difficulty raises the number of movers from 2 to 8, and their speed.
    """
    ends = opposite_ends(rng, SIZE, inset=END_DISTANCE, side_inset=2.5)
    count = round(between(MOVERS, difficulty))
    lanes = np.linspace(LANE_DISTANCE, SIZE[0] - LANE_DISTANCE, count)
    lanes += rng.uniform(-0.3, 0.3, count)
    hall = room(rng, SIZE, ends)
    movers = tuple(_mover(rng, i, float(x), difficulty) for i, x in enumerate(lanes))
    hall = replace(hall, movers=movers)
    crates = int(rng.integers(0, 4))
    return with_crates(rng, hall, crates, longest=0.8, radius=parameters.passage_radius)


def _mover(rng: np.random.Generator, number: int, x: float, difficulty: float) -> Mover:
    slow, fast = (between(ends, difficulty) for ends in zip(*SPEEDS, strict=True))
    speed = round(rng.uniform(slow, fast), 3)
    drives, width = bool(rng.uniform() < FORKLIFT_SHARE), SIZE[1]
    margin = 2.0 if drives else 0.7
    route = ((round(x, 3), margin, 0.0), (round(x, 3), width - margin, 0.0))
    if rng.integers(2):
        route = route[::-1]
    begin = round(rng.uniform(0.0, 2.0 * (width - 2.0 * margin)), 3)
    if drives:
        return Mover(
            f"forklift_{number}", FORKLIFT, route, speed, begin, backs_up=True, stands_off=1.0
        )
    return Mover(f"person_{number}", PERSON, route, speed, begin)
