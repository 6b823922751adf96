"""Rows of shelves and the beams between them, in a frame of their own.

`along` runs with the rows and `across` them; a range is (low, high) in metres.
"""

from __future__ import annotations

from itertools import pairwise
from math import ceil

import numpy as np
from numpy.typing import NDArray

from wayproof.models.worlds.aisle import Place, widest_gap
from wayproof.models.worlds.solids import Box

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
