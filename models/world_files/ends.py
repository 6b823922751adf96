"""Choice of start and goal in an imported scene: free for the robot, connected, and far apart."""

from __future__ import annotations

import itertools
from math import sqrt
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.world_files.free_space import (
    END_BAND,
    MAX_WALK_SLOPE,
    Grid,
    Ground,
    slope_of,
    to_edges,
)
from wayproof.models.world_files.movers import around_start
from wayproof.models.world_files.options import Found, ImportOptions
from wayproof.models.world_files.solids import solid_of
from wayproof.models.worlds.solids import Solid

if TYPE_CHECKING:
    from scipy import sparse

GENEROUS = 0.3
"""Clearance beyond the robot's radius that is tried first, m: a margin and two cells of 10 cm."""

SPARE = (GENEROUS, 0.2, 0.1, 0.05)
"""Clearances beyond the radius, tried in this order, m."""

ENCLOSED = (8, 7)
"""Directions of eight in which something stands, for a place to be inside; tried in this order."""

LEAST_INSIDE = 4.0
"""Free area from which a scene has an inside, m^2."""

INSIDE_SHARE = 0.1
"""Share of a scene's area from which that is its inside."""

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

    Both lie in one region of space that is free for the robot with some spare, on the floor, inside
    a building where there is one, and about as far apart on foot as the region allows.

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
    grid = Grid(low, high)
    ground = Ground(found.parts)
    i, j = np.indices(grid.shape).reshape(2, -1)
    heights = ground.height(grid.centres(i, j)).reshape(grid.shape)
    solids = _obstacles(found)
    radius, gaps = options.robot_radius, np.zeros(grid.shape)
    steps = (options.robot_step, 0.0) if options.robot_step and np.ptp(heights) else (0.0,)
    for band in (END_BAND, (0.05, options.robot_height)):
        apart = grid.distances(solids, heights, band, radius + GENEROUS + grid.cell)
        gaps = np.minimum(apart, to_edges(found, ground, grid, radius + GENEROUS + grid.cell))
        tried = itertools.product(steps, _preferred(grid, apart))
        for step, (within, note) in tried:
            for spare in SPARE:
                free = gaps > radius + spare
                ends = _pair(grid, free, within, heights, start, goal, step)
                if ends is not None and (ends.way >= SHORT or (within.all() and not step)):
                    notes = [note] if note else []
                    if band is not END_BAND:
                        notes.append(f"ends chosen for a height of {band[1]:g} m: too low to fly")
                    return _described(grid, ends, heights, gaps, start, goal, notes)
    widest = np.unravel_index(int(np.argmax(gaps)), gaps.shape)
    x, y = grid.centres(*(np.array([n]) for n in widest))[0]
    what = f"the widest place is {float(gaps.max()):.2f} m from everything, at ({x:.2f}, {y:.2f})"
    if start is not None or goal is not None:
        what = "nothing else can be reached from the given end"
    elif float(gaps.max()) > radius + SPARE[-1]:
        what += (
            f", but no two such places are joined by ground less steep than {MAX_WALK_SLOPE:g} rad"
            "; expected --start and --goal"
        )
    raise NoSpaceError(
        f"no space for a radius of {radius:g} m and {SPARE[-1]:g} m to spare: {what}"
    )


def has_inside(found: Found, low: Vector3, high: Vector3) -> bool:
    """Return whether a large part of the area between two corners is enclosed, as in a building."""
    grid, ground = Grid(low, high), Ground(found.parts)
    i, j = np.indices(grid.shape).reshape(2, -1)
    heights = ground.height(grid.centres(i, j)).reshape(grid.shape)
    solids = _obstacles(found)
    return len(_preferred(grid, grid.distances(solids, heights, END_BAND, 2.0 * grid.cell))) > 1


def _obstacles(found: Found) -> list[Solid]:
    """Return the solids that are no floor, and the movers where they begin."""
    standing = [solid_of(part) for part in found.parts if part.kind != "floor"]
    return [*standing, *map(around_start, found.movers)]


def _preferred(grid: Grid, gaps: NDArray[np.float64]) -> list[tuple[NDArray[np.bool_], str]]:
    """Return cells to choose from, best first: enclosed ones if there are many, then all."""
    found = []
    for least in ENCLOSED:
        cells = _enclosed(gaps <= grid.cell, least) & (gaps > grid.cell)
        if _is_large(grid, cells):
            found.append((cells, ""))
    note = "nothing enclosed has room for both ends: chosen outside too" if found else ""
    return [*found, (np.ones(grid.shape, np.bool_), note)]


class _Ends(NamedTuple):
    start: tuple[int, int]
    goal: tuple[int, int]
    way: float


def _pair(
    grid: Grid,
    free: NDArray[np.bool_],
    within: NDArray[np.bool_],
    heights: NDArray[np.float64],
    start: Vector3 | None,
    goal: Vector3 | None,
    step: float = 0.0,
) -> _Ends | None:
    """Return two cells of one free region that lie within some cells, as far apart as its ways go.

    With a step, heights in the region differ by no more than that. None without such a region.
    """
    slope = slope_of(grid, heights)
    labels = _regions(free & (slope <= MAX_WALK_SLOPE), heights, step)
    standing = (labels > 0) & (slope <= MAX_TILT) & within
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


def _is_large(grid: Grid, enclosed: NDArray[np.bool_]) -> bool:
    area = int(enclosed.sum()) * grid.cell**2
    return area >= max(LEAST_INSIDE, INSIDE_SHARE * enclosed.size * grid.cell**2)


def _enclosed(blocked: NDArray[np.bool_], least: int) -> NDArray[np.bool_]:  # (nx, ny)
    """Return cells with something in `least` of eight directions at least."""
    count = np.zeros(blocked.shape, np.int64)
    for axis in (0, 1):
        count += np.maximum.accumulate(blocked, axis=axis)
        count += np.flip(np.maximum.accumulate(np.flip(blocked, axis), axis=axis), axis)
    for flip in (False, True):
        side = np.flip(blocked, 1) if flip else blocked
        for turn in (False, True):
            seen = _diagonal(np.flip(side, (0, 1)) if turn else side)
            seen = np.flip(seen, (0, 1)) if turn else seen
            count += np.flip(seen, 1) if flip else seen
    return np.asarray(count >= least)


def _diagonal(blocked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return cells with a blocked one towards lower x and y along the diagonal."""
    if len(blocked) > blocked.shape[1]:  # row by row along the shorter side
        return _diagonal(blocked.T).T
    seen = blocked.copy()
    for i in range(1, len(seen)):
        seen[i, 1:] |= seen[i - 1, :-1]
    return seen


def _described(
    grid: Grid,
    ends: _Ends,
    heights: NDArray[np.float64],
    gaps: NDArray[np.float64],
    start: Vector3 | None,
    goal: Vector3 | None,
    notes: list[str],
) -> Chosen:
    """Return the ends as points, with notes on those that were chosen."""
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
