"""A warehouse: a partition with a doorway, rows of shelves, beams across the aisles, crates.

Shelves have a frame of their own: `along` runs with the rows and `across` them; a range is (low,
high) in metres.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import ceil

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds.aisle import Place, inspected, widest_gap
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


Range = tuple[float, float]
CentreLine = tuple[Place, Place]

WIDEST_CROSS_AISLE = 2.4
DEPTHS = (0.8, 1.0)
HEIGHTS = (2.2, 2.8)
SHORTEST, LONGEST = 1.2, 4.0
"""Least length between cross-aisles and greatest length of one shelf, m."""

LOWEST_BOARD = 0.10
"""Height of a rack's lowest board above the floor, and thickness of its end frames, m."""

BOARD_THICKNESS = 0.05
"""Thickness of a board, m."""

BEAM_UNDERSIDES = (1.0, 1.1)
BEAM_TOP = 1.3
"""Top of a beam, m: a quadruped passes below, and a drone has 1.2 m above it and below 2.5 m."""


def shelf_rows(
    rng: np.random.Generator, along: Range, across: Range, *, walled: bool, aisle: float
) -> tuple[list[Box], CentreLine | None]:
    """Draw two to four rows of shelves, broken by cross-aisles, with beams over some aisles.

    The centre line of the widest aisle between two rows comes with them, m.

    Args:
        rng: Draws everything.
        along: Begin and end of every row, m.
        across: Extent that the rows share, m.
        walled: Whether walls close `across`, so that an aisle is needed beyond the outer rows.
            Otherwise walls close `along`, and a row may have two cross-aisles.
        aisle: Minimum width of an aisle or cross-aisle, m.
    """
    rows = _rows(rng, across, walled, aisle)
    boxes = []
    for row in rows:
        cross_aisles = 1 if walled else int(rng.integers(1, 3))
        for shelf in _shelves(rng, along, cross_aisles, aisle):
            boxes += _shelf(rng, shelf, row)
    gap = widest_gap(rows)
    middle = None if gap is None else 0.5 * (gap[0] + gap[1])
    line = None if middle is None else ((along[0], middle), (along[1], middle))
    return boxes + _beams(rng, along, rows), line


def _rows(rng: np.random.Generator, across: Range, walled: bool, aisle: float) -> list[Range]:
    outer = aisle if walled else 0.0
    depth = rng.uniform(*DEPTHS)
    room = across[1] - across[0] - 2.0 * outer
    count = min(int(rng.integers(2, 5)), int((room + aisle) / (depth + aisle)))
    least = np.array([outer] + [aisle] * (count - 1) + [outer])
    gaps = _stretched(rng, least, across[1] - across[0] - count * depth)
    begins = across[0] + np.cumsum(gaps[:-1]) + depth * np.arange(count)
    return [(float(begin), float(begin + depth)) for begin in begins]


def _shelves(
    rng: np.random.Generator, along: Range, cross_aisles: int, aisle: float
) -> list[Range]:
    """Draw the limits of the shelves of one row."""
    widths = rng.uniform(aisle, WIDEST_CROSS_AISLE, cross_aisles)
    least = np.full(cross_aisles + 1, SHORTEST)
    lengths = _stretched(rng, least, along[1] - along[0] - float(widths.sum()))
    shelves: list[Range] = []
    begin = along[0]
    for length, width in zip(lengths, [*widths, 0.0], strict=True):
        cuts = np.linspace(begin, begin + length, ceil(length / LONGEST) + 1).tolist()
        shelves += pairwise(cuts)
        begin += length + width
    return shelves


def _stretched(
    rng: np.random.Generator, least: NDArray[np.float64], total: float
) -> NDArray[np.float64]:  # like `least`
    """Draw lengths of at least `least` that sum to `total`."""
    shares = rng.uniform(0.5, 1.5, len(least))
    return np.asarray(least + (total - least.sum()) * shares / shares.sum())


def _shelf(rng: np.random.Generator, along: Range, across: Range) -> list[Box]:
    """Draw a solid block, a rack on legs, or a rack that overhangs a narrower base."""
    height = rng.uniform(*HEIGHTS)
    kind = rng.choice(["solid", "legs", "base"])
    if kind == "solid":
        return [_box(along, across, (0.0, height))]
    if kind == "legs":
        return _rack(along, across, LOWEST_BOARD, height)
    base, recess = rng.uniform(0.6, 0.8), rng.uniform(0.1, 0.2)
    narrower = (across[0] + recess, across[1] - recess)
    return [_box(along, narrower, (0.0, base)), *_rack(along, across, base, height)]


def _rack(along: Range, across: Range, lowest: float, height: float) -> list[Box]:
    """Return boards from `lowest` to `height`, some 0.8 m apart, between two end frames."""
    foot = 0.0 if lowest == LOWEST_BOARD else lowest
    frames = [
        _box(side, across, (foot, height))
        for side in ((along[0], along[0] + LOWEST_BOARD), (along[1] - LOWEST_BOARD, along[1]))
    ]
    between = (along[0] + LOWEST_BOARD, along[1] - LOWEST_BOARD)
    levels = np.linspace(
        lowest, height - BOARD_THICKNESS, round((height - lowest) / 0.8) + 1
    ).tolist()
    return frames + [_box(between, across, (level, level + BOARD_THICKNESS)) for level in levels]


def _beams(rng: np.random.Generator, along: Range, rows: list[Range]) -> list[Box]:
    """Draw beams or conveyors from row to row, each over an aisle of its own."""
    aisles = [(near[1], far[0]) for near, far in pairwise(rows)]
    count = min(len(aisles), int(rng.integers(1, 3)))
    beams = []
    for aisle in rng.choice(len(aisles), count, replace=False):
        width = rng.uniform(0.3, 0.6)
        begin = rng.uniform(along[0] + 0.5, along[1] - 0.5 - width)
        height = (rng.uniform(*BEAM_UNDERSIDES), BEAM_TOP)
        beams.append(_box((begin, begin + width), aisles[aisle], height, "overhang"))
    return beams


def _box(along: Range, across: Range, height: Range, kind: str = "shelf") -> Box:
    return Box.between((along[0], across[0], height[0]), (along[1], across[1], height[1]), kind)
