"""A warehouse: a partition with a doorway, rows of shelves, beams across the aisles, crates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from wayproof.models.arrays import Vector3
from wayproof.models.worlds.layout import (
    WALL_HEIGHT,
    WALL_THICKNESS,
    heading_towards,
    mirrored,
    room_walls,
    with_crates,
)
from wayproof.models.worlds.shelves import MIN_AISLE_WIDTH, shelf_rows
from wayproof.models.worlds.solids import Box
from wayproof.models.worlds.solvability import first_solvable
from wayproof.models.worlds.world import World

LOW: Vector3 = (0.0, 0.0, -0.5)
HIGH: Vector3 = (20.0, 14.0, 3.0)

SHELVES_END = 16.6
"""End of the shelves and begin of the goal's end of the hall, m along x."""

START_REGION = ((1.2, 1.2), (3.0, 12.8))
GOAL_REGION = ((17.6, 1.2), (18.8, 12.8))
END_TO_END = (12.0, 17.0)
"""Straight distance from start to goal, m."""


def warehouse(seed: int, difficulty: float = 0.5) -> World:
    """Generate a 20 x 14 m hall, start and goal 12-17 m apart at its two ends.

    Difficulty scales the number of crates: 6 to 12 at 0.5.

    Raises:
        ValueError: The seed is negative, or the difficulty not from 0 to 1.
        RuntimeError: No draft let the reference bodies through.
    """
    return first_solvable("warehouse", seed, lambda rng: _draft(rng, seed, difficulty), difficulty)


def _draft(rng: np.random.Generator, seed: int, difficulty: float) -> World:
    partition_x = rng.uniform(4.6, 6.0)
    start, goal = _ends(rng)
    hall = World(
        name="warehouse",
        seed=seed,
        low=LOW,
        high=HIGH,
        solids=(
            *room_walls(LOW, HIGH),
            *_partition(rng, partition_x),
            *_storage(rng, partition_x + MIN_AISLE_WIDTH + 0.2),
        ),
        start=start,
        start_heading=heading_towards(rng, start, goal),
        goal=goal,
    )
    furnished = with_crates(
        rng, hall, count=round(2 * difficulty * int(rng.integers(6, 13))), longest=0.8
    )
    return mirrored(furnished, flip_x=bool(rng.integers(2)), flip_y=bool(rng.integers(2)))


def _ends(rng: np.random.Generator) -> tuple[Vector3, Vector3]:
    while True:
        start = np.round(rng.uniform(*START_REGION), 3).tolist()
        goal = np.round(rng.uniform(*GOAL_REGION), 3).tolist()
        if END_TO_END[0] <= np.hypot(goal[0] - start[0], goal[1] - start[1]) <= END_TO_END[1]:
            return (*start, 0.0), (*goal, 0.0)


def _partition(rng: np.random.Generator, x: float) -> list[Box]:
    """Draw a wall across the hall with one doorway, which ends below the ceiling in a lintel."""
    width = rng.uniform(1.6, 1.8)
    door = rng.uniform(LOW[1] + 1.5, HIGH[1] - 1.5 - width)
    door_height = rng.uniform(2.2, 2.4)
    near, far = x, x + 0.15
    return [
        Box.between((near, LOW[1] + WALL_THICKNESS, 0.0), (far, door, WALL_HEIGHT), "partition"),
        Box.between(
            (near, door + width, 0.0), (far, HIGH[1] - WALL_THICKNESS, WALL_HEIGHT), "partition"
        ),
        Box.between((near, door, door_height), (far, door + width, WALL_HEIGHT), "lintel"),
    ]


def _storage(rng: np.random.Generator, begin: float) -> list[Box]:
    """Draw shelves from `begin` on, their rows along the hall or across it."""
    x, y = (begin, SHELVES_END), (LOW[1] + WALL_THICKNESS, HIGH[1] - WALL_THICKNESS)
    if rng.integers(2):
        return shelf_rows(rng, along=x, across=y, walled=True)
    return [_transposed(box) for box in shelf_rows(rng, along=y, across=x, walled=False)]


def _transposed(box: Box) -> Box:
    """Return the box with x and y exchanged."""
    (x, y, z), (half_x, half_y, half_z) = box.centre, box.half_extents
    return replace(box, centre=(y, x, z), half_extents=(half_y, half_x, half_z))
