"""A warehouse: a partition with a doorway, rows of shelves, beams across the aisles, crates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds.aisle import inspected
from wayproof.models.worlds.generator import generated
from wayproof.models.worlds.layout import (
    LOW,
    WALL_HEIGHT,
    WALL_THICKNESS,
    Point,
    given_or,
    mirrored,
    room,
    with_crates,
)
from wayproof.models.worlds.shelves import CentreLine, shelf_rows
from wayproof.models.worlds.solids import Box
from wayproof.models.worlds.world import World

LENGTH, WIDTH = 20.0, 14.0

GOAL_END = 3.4
"""Length of the goal's end of the hall, beyond the shelves, m along x."""

END_DISTANCE = 1.2
"""Distance of start and goal from the outside of the walls, m."""

END_DEPTHS = (1.8, 1.2)
"""Extent of the regions of start and goal, m along x."""

END_TO_END = (8.0, 3.0)
"""Length of the hall less the least and the greatest straight distance from start to goal, m."""


@generated
def warehouse(rng: np.random.Generator, difficulty: float, parameters: WorldParameters) -> World:
    """Draw a hall of 20 x 14 m, start and goal 12-17 m apart at its two ends.

    Difficulty scales the number of crates: 6 to 12 at 0.5.
    """
    aisle = parameters.warehouse.aisle_width
    partition_x = rng.uniform(4.6, 6.0)
    ends = _ends(rng)
    partition = _partition(rng, partition_x)
    shelves, line = _storage(rng, partition_x + aisle + 0.2, aisle)
    hall = room(rng, (LENGTH, WIDTH), ends, (*partition, *shelves))
    hall = replace(hall, aisle=() if line is None else inspected(line))
    count = given_or(parameters.warehouse.crates, round(2 * difficulty * int(rng.integers(6, 13))))
    return mirrored(
        rng, with_crates(rng, hall, count, longest=0.8, radius=parameters.passage_radius)
    )


def _ends(rng: np.random.Generator) -> tuple[Point, Point]:
    least, most = (LENGTH - less for less in END_TO_END)
    y = (END_DISTANCE, WIDTH - END_DISTANCE)
    x_start = (END_DISTANCE, END_DISTANCE + END_DEPTHS[0])
    x_goal = (LENGTH - END_DISTANCE - END_DEPTHS[1], LENGTH - END_DISTANCE)
    while True:
        start = np.round(rng.uniform((x_start[0], y[0]), (x_start[1], y[1])), 3).tolist()
        goal = np.round(rng.uniform((x_goal[0], y[0]), (x_goal[1], y[1])), 3).tolist()
        if least <= np.hypot(goal[0] - start[0], goal[1] - start[1]) <= most:
            return (start[0], start[1]), (goal[0], goal[1])


def _partition(rng: np.random.Generator, x: float) -> list[Box]:
    """Draw a wall across the hall with one doorway, which ends below the ceiling in a lintel."""
    width, end = rng.uniform(1.6, 1.8), WIDTH
    door = rng.uniform(LOW[1] + 1.5, end - 1.5 - width)
    door_height = rng.uniform(2.2, 2.4)
    near, far = x, x + 0.15
    return [
        Box.between((near, LOW[1] + WALL_THICKNESS, 0.0), (far, door, WALL_HEIGHT), "partition"),
        Box.between(
            (near, door + width, 0.0), (far, end - WALL_THICKNESS, WALL_HEIGHT), "partition"
        ),
        Box.between((near, door, door_height), (far, door + width, WALL_HEIGHT), "lintel"),
    ]


def _storage(
    rng: np.random.Generator, begin: float, aisle: float
) -> tuple[list[Box], CentreLine | None]:
    """Draw shelves from `begin` on, their rows along the hall or across it, and name an aisle."""
    x = (begin, LENGTH - GOAL_END)
    y = (LOW[1] + WALL_THICKNESS, WIDTH - WALL_THICKNESS)
    if rng.integers(2):
        return shelf_rows(rng, along=x, across=y, walled=True, aisle=aisle)
    rows, line = shelf_rows(rng, along=y, across=x, walled=False, aisle=aisle)
    boxes = [_transposed(box) for box in rows]
    if line is None:
        return boxes, None
    (a, b), (c, d) = line
    return boxes, ((b, a), (d, c))


def _transposed(box: Box) -> Box:
    """Return the box with x and y exchanged."""
    (x, y, z), (half_x, half_y, half_z) = box.centre, box.half_extents
    return replace(box, centre=(y, x, z), half_extents=(half_y, half_x, half_z))
