"""A bent corridor with a few crates and little room to turn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds.generator import generated
from wayproof.models.worlds.layout import (
    WALL_HEIGHT,
    WALL_THICKNESS,
    Point,
    given_or,
    mirrored,
    room,
    with_crates,
)
from wayproof.models.worlds.solids import Box
from wayproof.models.worlds.world import World

LENGTH = 16.0
"""Length of the centre line from end wall to end wall, m."""

END_DISTANCE = 1.1
"""Distance of start and goal from the end walls, m."""


@generated
def corridor(rng: np.random.Generator, difficulty: float, parameters: WorldParameters) -> World:
    """Draw a corridor 2.0-2.4 m wide and 16 m long with one or two bends.

    Difficulty scales the number of crates: 2 to 4 at 0.5.
    """
    own = parameters.corridor
    width = given_or(own.width, rng.uniform(2.0, 2.4))
    shell = (_one_bend if rng.uniform() < 0.5 else _two_bends)(rng, width)
    count = given_or(own.crates, round(2 * difficulty * int(rng.integers(2, 5))))
    return mirrored(
        rng, with_crates(rng, shell, count, longest=0.6, radius=parameters.passage_radius)
    )


def _one_bend(rng: np.random.Generator, width: float) -> World:
    """Build a corridor east, then north: a rectangular room less one solid block."""
    first = rng.uniform(6.0, 10.0)
    inner = WALL_THICKNESS
    east, north = inner + first + width / 2, inner + LENGTH - first + width / 2
    block = _block((inner, inner + width), (east - width, north))
    return _shell(rng, width, (east, north), (east - width / 2, north - END_DISTANCE), block)


def _two_bends(rng: np.random.Generator, width: float) -> World:
    """Build a corridor east, north and east again: a room less two solid blocks."""
    first, second = (rng.uniform(*limits) for limits in ((4.5, 6.5), (4.0, 5.0)))
    inner = WALL_THICKNESS
    corner_x, corner_y = inner + first, inner + width / 2 + second  # of the centre line
    east, north = corner_x + LENGTH - first - second, corner_y + width / 2
    blocks = (
        _block((inner, inner + width), (corner_x - width / 2, north)),
        _block((corner_x + width / 2, inner), (east, north - width)),
    )
    return _shell(rng, width, (east, north), (east - END_DISTANCE, corner_y), *blocks)


def _block(low: Point, high: Point) -> Box:
    return Box.between((*low, 0.0), (*high, WALL_HEIGHT), "partition")


def _shell(
    rng: np.random.Generator, width: float, inside: Point, goal: Point, *blocks: Box
) -> World:
    """Return a room of blocks up to its inside, entered at its low corner, facing east."""
    start = (WALL_THICKNESS + END_DISTANCE, WALL_THICKNESS + width / 2)
    size, start, goal = (
        (round(x, 3), round(y, 3))
        for x, y in ((inside[0] + WALL_THICKNESS, inside[1] + WALL_THICKNESS), start, goal)
    )
    shell = room(rng, size, (start, (start[0] + 1.0, start[1])), blocks)
    return replace(shell, goal=(*goal, 0.0))
