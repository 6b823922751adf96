"""Why a piece of way was not admitted: the cells that the body overlaps, and their states."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.judge.body import Body, track_of
from wayproof.harness.judge.cells import OUTSIDE, SPACING, Cells, Integers, Mask
from wayproof.harness.log.paths import Array, densely
from wayproof.maps import OCCUPIED, UNKNOWN, Representation

Why = Literal["unknown", "stale", "occupied", "margin", "outside"]
"""Why a way was not admitted when it was entered."""

WORST_FIRST: tuple[Why, ...] = ("outside", "occupied", "unknown", "stale")
"""States of cells that a bare body may not overlap."""

MOST_CELLS = 12
"""Maximum number of cells that are named of one place."""

CLEARANCE_REACH = 1.0
"""Distance beyond which no clearance is measured, m."""


class Cell(NamedTuple):
    """A cell in the way.

    Attributes:
        place: Its centre, m; x and y of a column of a ground robot.
        state: `unknown`, `stale`, `occupied` or `outside`.
        gap_m: Distance between the body and the cell, m; below 0 where they overlap.
    """

    place: tuple[float, ...]
    state: str
    gap_m: float


@dataclass(frozen=True)
class Found:
    """The cells in the way of a piece.

    Attributes:
        why: The worst of what the bare body overlaps; `margin` if it overlaps nothing.
        cells: The nearest of them.
    """

    why: Why
    cells: tuple[Cell, ...]


def find_cause(
    body: Body,
    poses: Array,  # (n, 4) x, y, z, m, and heading, rad
    margin: float,  # m
    a_map: Representation,
    memory: Representation,  # the same without decay
) -> Found:
    """Find the cells in the way of a piece that was not admitted."""
    reach = body.radius + margin + 2.0 * a_map.resolution
    cells = body.cells(a_map, poses[:, :3], reach)
    wrong = body.wrong(cells)
    gaps = _gaps(body, cells, poses, wrong)
    remembered = body.cells(memory, poses[:, :3], reach).states
    found = [
        Cell(_centre(cells, index), _state(cells, remembered, index), float(gap))
        for index, gap in zip(np.argwhere(wrong), gaps, strict=True)
    ]
    found.sort(key=lambda cell: cell.gap_m)
    overlapped = [cell for cell in found if cell.gap_m < 0.0]
    for why in WORST_FIRST:
        named = tuple(cell for cell in overlapped if cell.state == why)
        if named:
            return Found(why, named[:MOST_CELLS])
    return Found("margin", tuple(found[:1]))


def clearance(body: Body, pose: Array, a_map: Representation) -> float:
    """Return the distance between the bare body at a pose (4,) and the nearest occupied cell, m.

    At most `CLEARANCE_REACH`; below 0 where they overlap.
    """
    poses = pose[None]
    cells = body.cells(a_map, poses[:, :3], body.radius + CLEARANCE_REACH)
    gaps = _gaps(body, cells, poses, cells.states == OCCUPIED)
    return float(min(gaps.min(initial=CLEARANCE_REACH), CLEARANCE_REACH))


def overlaps_occupied(body: Body, poses: Array, a_map: Representation) -> int:
    """Count the occupied cells that the bare body overlaps at or between poses (n, 4)."""
    cells = body.cells(a_map, poses[:, :3], body.radius)
    gaps = _gaps(body, cells, poses, cells.states == OCCUPIED)
    return int((gaps < 0.0).sum())


def _gaps(body: Body, cells: Cells, poses: Array, chosen: Mask) -> Array:
    """Return the distance of the bare body from each chosen cell, (k,) m, as `argwhere` orders."""
    low = cells.corner + np.argwhere(chosen) * cells.size
    gaps = np.full(len(low), np.inf)
    for offset, radius in body.discs:
        track = densely(track_of(poses, offset), SPACING * cells.size)[:, : cells.axes]
        for place in track:
            beyond = np.minimum(place - low, 0.0) + np.maximum(place - (low + cells.size), 0.0)
            gaps = np.minimum(gaps, np.sqrt((beyond * beyond).sum(axis=-1)) - radius)
    return gaps


def _centre(cells: Cells, index: Integers) -> tuple[float, ...]:
    centre = cells.corner[: cells.axes] + (index + 0.5) * cells.size
    return tuple(round(float(value), 3) for value in centre)


def _state(cells: Cells, remembered: NDArray[np.uint8], index: Integers) -> str:
    state, known = cells.states[tuple(index)], remembered[tuple(index)] != UNKNOWN
    if state == OUTSIDE:
        return "outside"
    if state == UNKNOWN:
        return "stale" if known else "unknown"
    return "occupied"
