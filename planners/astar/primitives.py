"""Motion primitives of a body of discs: the cells that steps and turns touch."""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray

from wayproof.planners.kernels.angles import cosine_sine, wrap, yaw_of_direction
from wayproof.planners.kernels.grid import Floats
from wayproof.planners.kernels.se2_search import HEADINGS, Primitives, SweptCells

Longs = NDArray[np.int64]

STEPS = (
    (1, 0), (2, 1), (1, 1), (1, 2), (0, 1), (-1, 2), (-1, 1), (-2, 1),
    (-1, 0), (-2, -1), (-1, -1), (-1, -2), (0, -1), (1, -2), (1, -1), (2, -1),
)  # fmt: skip
"""Steps of the headings, nodes, counterclockwise."""

LENGTHS = {1: 12, 2: 17, 5: 27}
"""Squared length of a step -> its length, 1, 2^0.5 or 5^0.5, in twelfths."""

SAMPLES = 16
"""Number of points along a step or turn, for each cell of its length, whose cells are taken."""

BESIDE = 0.02
"""Offset of further points beside those, cells: a line through a corner touches four cells."""


@functools.lru_cache(maxsize=1)
def headings() -> list[float]:
    """Return the headings of the steps, rad."""
    return [float(yaw_of_direction(float(x), float(y))) for x, y in STEPS]


@functools.lru_cache(maxsize=16)
def motion_primitives(offsets: tuple[float, ...], threshold: int, factor: int) -> Primitives:
    """Return tables of the cells that discs touch on each motion, the costs left at 0.

    Args:
        offsets: Offsets of the discs along the body, cells.
        threshold: A cell is forbidden at or below this squared distance.
        factor: Grid cells to a node along each axis.
    """
    angles = headings()
    shares = np.linspace(0.0, 1.0, SAMPLES * factor + 1)
    steps, turns = [], []
    for heading, (x, y) in enumerate(STEPS):
        cosine, sine = cosine_sine(angles[heading])
        moved = factor * shares[:, None] * np.array([x, y])
        steps.append([_cells(moved + offset * np.array([cosine, sine])) for offset in offsets])
        turn = float(wrap(angles[(heading + 1) % HEADINGS] - angles[heading]))
        spun = np.array([cosine_sine(angles[heading] + share * turn) for share in shares])
        turns.append([_cells(offset * spun) for offset in offsets])
    spins = [np.unique(np.concatenate(parts), axis=0) for parts in zip(*turns, strict=True)]
    return Primitives(
        steps=np.array(STEPS, np.int64),
        lengths=np.array([LENGTHS[x * x + y * y] for x, y in STEPS], np.int64),
        stepped=_swept(steps, threshold),
        turned=_swept(turns, threshold),
        spun=_swept([spins], threshold),
        turn_cost=0,
        reversal_cost=0,
    )


def _cells(track: Floats) -> Longs:
    """Return the cells (k, 2) in or next to which points lie, from the centre of a cell, cells."""
    beside = BESIDE * np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)])
    points = (track[:, None] + beside).reshape(-1, 2)
    found: Longs = np.unique(np.floor(points + 0.5).astype(np.int64), axis=0)
    return found


def _swept(motions: list[list[Longs]], threshold: int) -> SweptCells:
    """Return tables of the cells that each disc touches on each motion."""
    shape = len(motions), len(motions[0])
    counts = np.array([[len(cells) for cells in discs] for discs in motions], np.int64)
    table = np.zeros((*shape, int(counts.max()), 2), np.int64)
    middles = np.zeros((*shape, 2), np.int64)
    reaches, enough = np.zeros(shape, np.int64), np.zeros(shape, np.int64)
    for at in np.ndindex(shape):
        cells = motions[at[0]][at[1]]
        table[at][: len(cells)] = cells
        apart = cells[:, None] - cells  # (k, k, 2)
        squared = (apart * apart).sum(axis=2).max(axis=1)
        middle = int(np.argmin(squared))
        middles[at], reaches[at] = cells[middle], np.abs(apart[middle]).max()
        reach = math.sqrt(threshold) + math.sqrt(squared[middle])
        enough[at] = math.ceil(reach * reach)
    return SweptCells(table, counts, middles, reaches, enough)
