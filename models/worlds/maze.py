"""A maze of walls: a tree of passages in which some walls are taken out again."""

from __future__ import annotations

from collections import deque
from itertools import groupby

import numpy as np

from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds.generator import generated
from wayproof.models.worlds.layout import WALL_HEIGHT, WALL_THICKNESS, between, room
from wayproof.models.worlds.solids import Box
from wayproof.models.worlds.world import World

Cell = tuple[int, int]

PITCHES = (2.6, 2.1)
"""Distance from wall to wall, middle to middle, at difficulty 0 and 1, m."""

SIZE = (6, 5)
"""Cells along x and y."""

LONGEST_WAY = 15.0
"""Greatest length of the way from start to goal along the passages, m."""

THICKNESS = 0.15


@generated
def maze(rng: np.random.Generator, difficulty: float, parameters: WorldParameters) -> World:
    """Draw a maze of 6 x 5 cells, the goal as far as 15 m along its passages.

    Difficulty narrows the passages from 2.45 to 1.95 m and leaves fewer loops: at 1 there is one
    way alone.
    """
    pitch = round(between(PITCHES, difficulty), 3)
    open_sides = _tree(rng)
    _add_loops(rng, open_sides, 0.4 * (1.0 - difficulty))
    origin = WALL_THICKNESS - THICKNESS / 2
    first = (int(rng.integers(2)) * (SIZE[0] - 1), int(rng.integers(SIZE[1])))
    last = _far_cell(open_sides, first, int(LONGEST_WAY / pitch))
    start, goal = (
        (round(origin + (i + 0.5) * pitch, 3), round(origin + (j + 0.5) * pitch, 3))
        for i, j in (first, last)
    )
    length, width = (round(2 * origin + n * pitch, 3) for n in SIZE)
    return room(rng, (length, width), (start, goal), _walls(open_sides, pitch, origin))


def _tree(rng: np.random.Generator) -> set[frozenset[Cell]]:
    """Draw pairs of neighbours without a wall between them, by a random depth-first search."""
    path = [(int(rng.integers(SIZE[0])), int(rng.integers(SIZE[1])))]
    seen, open_sides = set(path), set()
    while path:
        fresh = [cell for cell in _neighbours(path[-1]) if cell not in seen]
        if not fresh:
            path.pop()
            continue
        cell = fresh[int(rng.integers(len(fresh)))]
        open_sides.add(frozenset((path[-1], cell)))
        seen.add(cell)
        path.append(cell)
    return open_sides


def _add_loops(rng: np.random.Generator, open_sides: set[frozenset[Cell]], share: float) -> None:
    """Remove a share of the inner walls, in place."""
    for side in _sides():
        if rng.uniform() < share:
            open_sides.add(side)


def _sides() -> list[frozenset[Cell]]:
    """Return every pair of neighbours, in a fixed order."""
    cells = [(i, j) for i in range(SIZE[0]) for j in range(SIZE[1])]
    return [frozenset((a, b)) for a in cells for b in _neighbours(a) if a < b]


def _neighbours(cell: Cell) -> list[Cell]:
    i, j = cell
    around = [(i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)]
    return [(i, j) for i, j in around if 0 <= i < SIZE[0] and 0 <= j < SIZE[1]]


def _far_cell(open_sides: set[frozenset[Cell]], first: Cell, most: int) -> Cell:
    """Return the cell farthest from the first along the passages, up to a number of steps."""
    steps, queue = {first: 0}, deque([first])
    while queue:
        cell = queue.popleft()
        for other in _neighbours(cell):
            if other not in steps and frozenset((cell, other)) in open_sides:
                steps[other] = steps[cell] + 1
                queue.append(other)
    return max((count, cell) for cell, count in steps.items() if count <= most)[1]


def _walls(open_sides: set[frozenset[Cell]], pitch: float, origin: float) -> list[Box]:
    """Return the standing walls, each as long as it runs in one line."""
    walls = []
    shut = [tuple(sorted(side)) for side in _sides() if side not in open_sides]
    for across in (0, 1):  # walls across x, that is along y; then along x
        along = 1 - across
        here = sorted(
            (a[across] + 1, a[along]) for a, b in shut if a[along] == b[along]
        )  # (line, place along it)
        runs = groupby(enumerate(here), key=lambda item: (item[1][0], item[1][1] - item[0]))
        for (line, _), run in runs:
            places = [place for _, (_, place) in run]
            low, high = [0.0, 0.0, 0.0], [0.0, 0.0, WALL_HEIGHT]
            low[across] = origin + line * pitch - THICKNESS / 2
            high[across] = low[across] + THICKNESS
            low[along] = origin + places[0] * pitch - THICKNESS / 2
            high[along] = origin + (places[-1] + 1) * pitch + THICKNESS / 2
            corners = (low[0], low[1], low[2]), (high[0], high[1], high[2])
            walls.append(Box.between(*corners, "partition"))
    return walls
