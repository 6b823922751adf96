"""Choice of start and goal in an imported scene: free for the robot, connected, and far apart."""

from __future__ import annotations

from math import sqrt
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.world_files.free_space import (
    END_BAND,
    LEAST_CELL,
    MAX_WALK_SLOPE,
    Grid,
    Survey,
    slope_of,
    survey,
)
from wayproof.models.world_files.options import Found, ImportOptions

if TYPE_CHECKING:
    from scipy import sparse

SPARE = (0.3, 0.2, 0.1, 0.05)
"""Clearances beyond the radius, tried in this order, m: first a margin and two cells of 10 cm."""

MAX_TILT = 0.12
"""Steepest ground at a chosen end, rad."""

MAX_RISE = 0.5
"""Difference in height between chosen ends, m, where there is a choice."""

SHORT = 2.0
"""Length of a way below which it is called short, m."""


class Chosen(NamedTuple):
    """Start and goal.

    Attributes:
        start: Start on the floor, m.
        goal: Goal on the floor, m.
        notes: Notes on the choice, and why it may be poor.
        way: Length of the way between them, m.
    """

    start: Vector3
    goal: Vector3
    notes: list[str]
    way: float


class NoSpaceError(ValueError):
    """The scene has no place for the robot; the message says where the widest one is."""


def choose_ends(
    found: Found,
    low: Vector3,
    high: Vector3,
    options: ImportOptions,
    start: Vector3 | None = None,
    goal: Vector3 | None = None,
) -> Chosen:
    """Choose start and goal, or the one that is missing.

    Both lie in the largest region of space that is free for the robot with some spare, on the
    floor, and about as far apart on foot as it allows.

    Args:
        found: Scene with its floor at 0, or terrain.
        low: Lower corner of the operating area, m.
        high: Upper corner, m.
        options: The robot's radius and height.
        start: Given, m.
        goal: Given, m.

    Raises:
        NoSpaceError: No place for the robot, or none that the given end can be reached from.
    """
    radius = options.robot_radius
    for band in (END_BAND, (0.05, options.robot_height)):
        seen = survey(found, low, high, band, radius + SPARE[0] + LEAST_CELL)
        rises = options.robot_step and np.ptp(seen.heights)
        low_roof = f"ends chosen for a height of {band[1]:g} m: too low to fly"
        notes = [] if band is END_BAND else [low_roof]
        short: _Ends | None = None
        for step in (options.robot_step, 0.0) if rises else (0.0,):
            for spare in SPARE:
                ends = _pair(seen, seen.gaps > radius + spare, start, goal, step)
                if ends is not None and ends.way >= SHORT:
                    return _described(seen, ends, start, goal, notes)
                if ends is not None and (short is None or ends.way > short.way):
                    short = ends
        if short is not None:
            return _described(seen, short, start, goal, notes)
    widest = np.unravel_index(int(np.argmax(seen.gaps)), seen.gaps.shape)
    x, y = seen.grid.centres(*(np.array([n]) for n in widest))[0]
    most = float(seen.gaps.max())
    what = f"the widest place is {most:.2f} m from everything, at ({x:.2f}, {y:.2f})"
    if start is not None or goal is not None:
        what = "nothing else can be reached from the given end"
    elif most > radius + SPARE[-1]:
        what += (
            f", but no two such places are joined by ground less steep than {MAX_WALK_SLOPE:g} rad"
            "; expected --start and --goal"
        )
    raise NoSpaceError(
        f"no space for a radius of {radius:g} m and {SPARE[-1]:g} m to spare: {what}"
    )


class _Ends(NamedTuple):
    start: tuple[int, int]
    goal: tuple[int, int]
    way: float


def _pair(
    seen: Survey,
    free: NDArray[np.bool_],
    start: Vector3 | None,
    goal: Vector3 | None,
    step: float,
) -> _Ends | None:
    """Return two cells of the largest free region, as far apart as its ways go; None without one.

    With a step, heights in the region differ by no more than that.
    """
    grid, heights, _ = seen
    slope = slope_of(grid, heights)
    labels = _regions(free & (slope <= MAX_WALK_SLOPE), heights, step)
    standing = (labels > 0) & (slope <= MAX_TILT)
    given = start or goal
    if given is not None:
        cell = tuple(((np.array(given[:2]) - grid.low) / grid.cell).astype(int).tolist())
        if not all(0 <= n < most for n, most in zip(cell, grid.shape, strict=True)):
            return None
        region = labels == labels[cell]
        if not labels[cell] or not (standing & region).any():
            return None
        return _farthest_from(grid, region, standing & region, cell, swap=start is None)
    sizes = np.bincount(labels[standing], minlength=labels.max() + 1)
    sizes[0] = 0
    if not sizes.any():
        return None
    region = labels == int(np.argmax(sizes))
    places = standing & region
    level = np.abs(heights - np.median(heights[places])) <= MAX_RISE / 2.0
    places = places & level if (places & level).sum() > 1 else places
    i, j = np.nonzero(places)
    first = int(np.argmin(i + j))
    seed = (int(i[first]), int(j[first]))
    ends = _farthest_from(grid, region, places, seed, swap=False)
    if ends is None:
        return None
    return _farthest_from(grid, region, places, ends.goal, swap=True)


def _regions(
    free: NDArray[np.bool_], heights: NDArray[np.float64], step: float
) -> NDArray[np.int64]:  # (nx, ny)
    """Number the connected regions of free cells from 1; with a step, each of one level."""
    from scipy import ndimage

    if not step:
        return np.asarray(ndimage.label(free, np.ones((3, 3)))[0], np.int64)
    most = float(np.median(heights[free])) if free.any() else 0.0
    levels = np.floor((heights - most) / step + 0.5).astype(np.int64)  # one about the most usual
    labels, count = np.zeros(free.shape, np.int64), 0
    for level in np.unique(levels[free]):
        own, number = ndimage.label(free & (levels == level), np.ones((3, 3)))
        labels[own > 0] = own[own > 0] + count
        count += number
    return labels


def _farthest_from(
    grid: Grid, region: NDArray[np.bool_], places: NDArray[np.bool_], cell: tuple[int, int],
    *, swap: bool,
) -> _Ends | None:  # fmt: skip
    """Return a cell and the place in the region that is farthest from it on foot."""
    from scipy.sparse import csgraph

    number = np.full(region.shape, -1)
    number[region] = np.arange(int(region.sum()))
    ways = csgraph.dijkstra(_graph(region, number, grid.cell), indices=int(number[cell]))
    ways = np.where(np.isfinite(ways), ways, -1.0)
    candidates = number[places]
    best = candidates[int(np.argmax(ways[candidates]))]
    i, j = np.nonzero(region)
    other = (int(i[best]), int(j[best]))
    if other == cell:
        return None
    way = float(ways[best])
    return _Ends(other, cell, way) if swap else _Ends(cell, other, way)


def _graph(region: NDArray[np.bool_], number: NDArray[np.int64], cell: float) -> sparse.csr_matrix:
    """Return the ways between neighbouring cells of a region, m."""
    from scipy import sparse

    tails, heads, lengths = [], [], []
    for tail, head, length in (
        (np.s_[:-1, :], np.s_[1:, :], cell),
        (np.s_[:, :-1], np.s_[:, 1:], cell),
        (np.s_[:-1, :-1], np.s_[1:, 1:], cell * sqrt(2.0)),
        (np.s_[:-1, 1:], np.s_[1:, :-1], cell * sqrt(2.0)),
    ):
        both = region[tail] & region[head]
        for a, b in ((tail, head), (head, tail)):
            tails.append(number[a][both])
            heads.append(number[b][both])
            lengths.append(np.full(int(both.sum()), length))
    count = int(region.sum())
    edges = (np.concatenate(lengths), (np.concatenate(tails), np.concatenate(heads)))
    return sparse.csr_matrix(edges, shape=(count, count))


def _described(
    seen: Survey, ends: _Ends, start: Vector3 | None, goal: Vector3 | None, notes: list[str]
) -> Chosen:
    """Return the ends as points, with notes on those that were chosen."""
    grid, heights, gaps = seen
    points: list[Vector3] = []
    for name, given, cell in (("start", start, ends.start), ("goal", goal, ends.goal)):
        if given is not None:
            points.append(given)
            continue
        x, y = grid.centres(np.array([cell[0]]), np.array([cell[1]])).round(3)[0].tolist()
        points.append((x, y, round(float(heights[cell]), 4)))
        clear = f"{float(gaps[cell]):.2f} m clear"
        notes.append(f"{name} chosen: ({x:g}, {y:g}), {clear}")
    notes.append(f"way from start to goal: {ends.way:.1f} m")
    if ends.way < SHORT:
        notes[-1] += ", which is short: nothing farther is connected"
    return Chosen(points[0], points[1], notes, ends.way)
