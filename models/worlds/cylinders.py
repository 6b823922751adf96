"""A dense field of pillars grown by a cellular automaton, with one winding way left open.

After the worlds of BARN (Perille et al. 2020, "Benchmarking Metric Ground Navigation"): cells are
filled at random, then smoothed by their neighbours. BARN's passages suit a wheeled robot of 0.25 m;
cells and passages here suit the wider bodies of this project, and pillars are as high as the walls.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds.generator import generated
from wayproof.models.worlds.layout import (
    LOW,
    WALL_HEIGHT,
    WALL_THICKNESS,
    Point,
    between,
    given_or,
    opposite_ends,
    room,
)
from wayproof.models.worlds.solids import Cylinder
from wayproof.models.worlds.solvability import passage_radius
from wayproof.models.worlds.world import World

SIZE = (16.0, 10.0)
PILLAR_RADIUS = 0.2
CELL = 0.4
FILLED_SHARE = (0.10, 0.34)
"""Share of the cells filled at random, at difficulty 0 and 1; BARN takes 0.15 to 0.30."""

BIRTH, DEATH = 5, 1
"""A cell with at least 5 filled neighbours of 8 is filled, one with at most 1 is emptied."""

SMOOTHINGS = (1, 3)
WAY_MARGIN = 0.12
"""Excess of the open way over the passage on either side, m."""

END_DISTANCE = 1.3
"""Distance of start and goal from the walls, m."""


@generated
def cylinders(rng: np.random.Generator, difficulty: float, parameters: WorldParameters) -> World:
    """Draw pillars in a 16 x 10 m hall, start and goal at its two ends.

    Difficulty raises the share of the cells that are filled and narrows the way left open.
    """
    start, goal = opposite_ends(rng, SIZE, inset=END_DISTANCE, side_inset=END_DISTANCE)
    centres = _filled_cells(rng, between(FILLED_SHARE, difficulty))
    way, radius = _way(rng, start, goal), PILLAR_RADIUS
    away = np.linalg.norm(centres[:, None] - way[None], axis=2).min(axis=1)
    ends = np.linalg.norm(centres[:, None] - np.array([start, goal])[None], axis=2)
    passage = given_or(parameters.passage_radius, passage_radius(difficulty))
    keep = (away > passage + radius + WAY_MARGIN) & (ends.min(axis=1) > END_DISTANCE)
    pillars = (
        Cylinder((x, y, 0.0), (x, y, WALL_HEIGHT), radius, "pillar")
        for x, y in np.round(centres[keep], 3).tolist()
    )
    return room(rng, SIZE, (start, goal), pillars)


def _filled_cells(rng: np.random.Generator, share: float) -> NDArray[np.float64]:  # (n, 2)
    """Return centres of the cells that are filled after smoothing, m."""
    from scipy import ndimage  # slow to load

    inside = np.subtract(SIZE, LOW[:2]) - 2 * WALL_THICKNESS
    filled = rng.uniform(size=tuple((inside / CELL).astype(int))) < share
    around = np.ones((3, 3), np.int64)
    for _ in range(int(rng.integers(SMOOTHINGS[0], SMOOTHINGS[1] + 1))):
        neighbours = ndimage.convolve(filled.astype(np.int64), around, mode="constant") - filled
        filled = (filled & (neighbours > DEATH)) | (neighbours >= BIRTH)
    corner = np.add(LOW[:2], WALL_THICKNESS)
    return np.asarray(corner + (np.argwhere(filled) + 0.5) * CELL)


def _way(rng: np.random.Generator, start: Point, goal: Point) -> NDArray[np.float64]:  # (n, 2)
    """Return points 0.1 m apart along a polyline from start to goal through two points between."""
    x = np.linspace(start[0], goal[0], 4)
    y = [start[1], *rng.uniform(LOW[1] + END_DISTANCE, SIZE[1] - END_DISTANCE, 2), goal[1]]
    along = np.linspace(x[0], x[-1], round(10 * (x[-1] - x[0])))
    return np.column_stack([along, np.interp(along, x, y)])
