"""States of the cells around a path, and distances between them, by simple code.

It shares nothing with the costmap of the stack, so that the audit and the check of reasons are
independent of what they check.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.judge.slopes import SlopingColumns
from wayproof.harness.log.paths import Array, densely
from wayproof.harness.mission import Mission
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, states_in
from wayproof.maps.columns import ColumnMap
from wayproof.models.grids import distances

Integers = NDArray[np.int64]
Mask = NDArray[np.bool_]

SPACING = 0.25
"""Spacing of the points at which a path is checked, cells."""

SLIVER = 1e-7
"""Tolerance for rounding, m: a face within it of a bound is on neither side."""

HEIGHT_SHIFT = np.array([0.0, 0.0, 0.75])
"""Offset of the index of a cell along each axis, cells: the floor is high in its layer."""

SHELL = 512
"""Number of neighbours of each cell of a path that are read at once."""

OUTSIDE = 3
"""State of a cell outside the operating area; it blocks as an occupied one does."""

NAMES = {FREE: "free", UNKNOWN: "unknown", OCCUPIED: "occupied", OUTSIDE: "outside"}
"""Names of the states in reasons."""


@dataclass(frozen=True)
class Cells:
    """Cells around a path: squares of columns for a body that walks, cubes for one that flies.

    Attributes:
        states: (nx, ny) or (nx, ny, nz).
        corner: (2,) or (3,) lower corner of the first cell, m.
        size: Edge of a cell, m.
        first: (2,) or (3,) index of the first cell among those of all space.
    """

    states: NDArray[np.uint8]
    corner: Array
    size: float
    first: Integers

    @property
    def axes(self) -> int:
        """Number of axes: 2 for columns, 3 for cubes."""
        return self.states.ndim

    @property
    def occupied(self) -> Mask:
        """Mask of cells that are occupied or outside the operating area."""
        occupied: Mask = (self.states == OCCUPIED) | (self.states == OUTSIDE)
        return occupied

    @property
    def not_free(self) -> Mask:
        """Mask of cells that are occupied, outside or unknown."""
        not_free: Mask = self.states != FREE
        return not_free

    def wrong(self, unknown_blocks: bool) -> Mask:
        """Return the mask of cells that the body may not overlap."""
        return self.not_free if unknown_blocks else self.occupied

    def clearances(self, unknown_blocks: bool) -> Array:
        """Return the distance of each cell to the nearest that the body may not overlap, cells."""
        wrong = np.pad(self.wrong(unknown_blocks), 1, constant_values=True)
        return distances(wrong)[(slice(1, -1),) * self.axes]

    def of(self, points: Array) -> Integers:
        """Return the cells (n, 2 or 3) that contain points (n, 3), m.

        By the law of the map's cells. Measured from the corner, a point on a face, such as a goal
        at 6 m, could be rounded into the cell before it.
        """
        cells = np.floor(points[:, : self.axes] / self.size + HEIGHT_SHIFT[: self.axes])
        inside: Integers = cells.astype(np.int64) - self.first
        return inside

    def touched(self, path: Array) -> Integers:
        """Return the distinct cells of points a quarter of a cell apart along a path (n, 3), m."""
        return np.unique(self.of(densely(path, SPACING * self.size)), axis=0)

    def within(self, cells: Integers, wrong: Mask, reach: float) -> Mask:
        """Return whether a wrong cell is within a reach, cells, of each cell, (n,)."""
        offsets, _ = ball(self.axes, reach)
        flat, none = wrong.ravel(), np.zeros((1, self.axes), np.int64)
        found, places = np.unique(self._indices(cells, none)[:, 0], return_inverse=True)
        around = self._indices(offsets, none)[:, 0]
        near = [flat[index + around].any() for index in found]
        return np.array(near, np.bool_)[places]

    def least_distance(self, cells: Integers, wrong: Mask, reach: float) -> float:
        """Return the least distance of some cells to wrong ones, cells, at most the reach."""
        offsets, squares = ball(self.axes, reach)
        flat = wrong.ravel()
        for first in range(0, len(offsets), SHELL):
            shell = slice(first, first + SHELL)
            met = flat[self._indices(cells, offsets[shell])].any(axis=0)
            if met.any():
                return math.sqrt(squares[shell][int(met.argmax())])
        return reach

    def near(self, cells: Integers, wrong: Mask, reach: float) -> Integers:
        """Return the wrong cells (m, axes) within a reach, cells, of any of some cells."""
        offsets, _ = ball(self.axes, reach)
        seen = np.zeros(wrong.size, np.bool_)
        for cell in cells:
            seen[self._indices(cell[None], offsets)] = True
        found: Integers = np.argwhere(wrong & seen.reshape(wrong.shape))
        return found

    def _indices(self, cells: Integers, offsets: Integers) -> Integers:
        """Return the flat indices (n, m) of each cell (n,) plus each offset (m,)."""
        shape = self.states.shape
        strides = np.array([math.prod(shape[axis + 1 :]) for axis in range(self.axes)])
        here, there = (cells * strides).sum(axis=1), (offsets * strides).sum(axis=1)
        indices: Integers = here[:, None] + there[None]
        return indices


@lru_cache(maxsize=32)
def ball(axes: int, reach: float) -> tuple[Integers, Integers]:
    """Return offsets (n, axes) of all cells within a reach, and their squares (n,), nearest first.

    All in cells.
    """
    steps = np.arange(-math.floor(reach), math.floor(reach) + 1)
    offsets = np.stack(np.meshgrid(*(axes * [steps])), axis=-1).reshape(-1, axes)
    squares = (offsets**2).sum(axis=1)
    order = np.argsort(squares, kind="stable")
    order = order[squares[order] <= reach * reach]
    return offsets[order], squares[order]


def reach_to(square: int) -> float:
    """Return the reach, cells, of all cells of up to a squared distance, which is whole.

    The root of that itself may be rounded down, so that it leaves the farthest cells out.
    """
    return math.sqrt(square + 0.5)


def cells_around(
    voxel_map: ColumnMap,
    path: Array,
    reach: float,
    config: Config,
    mission: Mission,
    widening: Sequence[int] = (),
    sloping: SlopingColumns | None = None,
) -> Cells:
    """Return the cells within a reach, m, plus two cells, of a path (n, 3), m.

    With a widening, cells along x and y, each has the worst state of the cells within it.

    Args:
        voxel_map: Map of the decision.
        path: Points (n, 3), m.
        reach: m.
        config: Settings.
        mission: Body and operating area.
        widening: Cells by which what is blocked is widened along x and y; empty if by none.
        sloping: Columns of a body that climbs, in place of those of a flat floor.
    """
    size, flat = voxel_map.resolution, mission.planar
    pad = reach + (3.0 + max(widening, default=0)) * size
    low, high = path[:, :3].min(axis=0) - pad, path[:, :3].max(axis=0) + pad
    if flat:
        low[2], high[2] = mission.low[2] - size, mission.height + 2.0 * size
    first = np.floor(low / size + HEIGHT_SHIFT)
    end = np.ceil(high / size + HEIGHT_SHIFT)
    corner = (first - HEIGHT_SHIFT) * size
    if sloping is not None:
        corner = corner[:2]
        states = sloping.within(first[:2].astype(np.int64), end[:2].astype(np.int64))
    else:
        # The corners are those of cells; a quarter of a cell inwards they select the same cells.
        above = (end - HEIGHT_SHIFT) * size
        states = states_in(voxel_map, corner + 0.25 * size, above - 0.25 * size)
    if flat and sloping is None:
        states, corner = columns(states, float(corner[2]), size, mission), corner[:2]
    states = fenced(states, corner, size, config, mission)
    if any(widening):
        states = widened(states, widening)
    return Cells(states, corner, size, first[: states.ndim].astype(np.int64))


def widened(states: NDArray[np.uint8], widening: Sequence[int]) -> NDArray[np.uint8]:
    """Return the worst state within some cells along x and y; what is outside counts as occupied.

    Cells outside stay so.
    """
    from scipy import ndimage

    box = np.ones([2 * cells + 1 for cells in widening] + [1] * (states.ndim - 2), bool)
    blocked = ndimage.binary_dilation((states == OCCUPIED) | (states == OUTSIDE), box)
    not_free = ndimage.binary_dilation(states != FREE, box)
    worst = np.where(blocked, OCCUPIED, np.where(not_free, UNKNOWN, FREE))
    return np.where(states == OUTSIDE, OUTSIDE, worst).astype(np.uint8)


def fenced(
    states: NDArray[np.uint8], corner: Array, size: float, config: Config, mission: Mission
) -> NDArray[np.uint8]:
    """Return the states with `OUTSIDE` where a cell does not overlap the operating area.

    In height it must lie entirely between the altitude limits of the config.
    """
    states = states.copy()
    for axis in range(states.ndim):
        low, high = mission.low[axis], mission.high[axis]
        edges = corner[axis] + np.arange(states.shape[axis]) * size
        outside = (edges + size <= low + SLIVER) | (edges >= high - SLIVER)
        if axis == 2:
            bottom, top = config.motion.altitude_low, config.motion.altitude_high
            outside |= (edges < bottom - SLIVER) | (edges + size > top + SLIVER)
        states[(slice(None),) * axis + (outside,)] = OUTSIDE
    return states


def columns(
    states: NDArray[np.uint8], bottom: float, size: float, mission: Mission
) -> NDArray[np.uint8]:
    """Return the worst state in each column (nx, ny) at the heights of a walking body.

    Free cells below seen floor are no hole, but beside one.
    """
    lower = bottom + np.arange(states.shape[2]) * size  # edge of each layer
    inside = lower + size > mission.low[2] + SLIVER
    below = inside & (lower + size <= SLIVER)
    floor = (lower + size > SLIVER) & (lower + size <= mission.step_height + SLIVER)
    band = (lower + size > mission.step_height + SLIVER) & (lower < mission.height - SLIVER)
    occupied, free = states == OCCUPIED, states == FREE
    through, seen = free[:, :, below].any(axis=2), occupied[:, :, floor].any(axis=2)
    nx, ny = through.shape
    holes = np.pad(through & ~seen, 1)
    beside = [holes[i : i + nx, j : j + ny] for i in range(3) for j in range(3)]
    blocked = occupied[:, :, band].any(axis=2) | (through & np.any(beside, axis=0))
    standing = seen & free[:, :, band].all(axis=2)
    return np.where(blocked, OCCUPIED, np.where(standing, FREE, UNKNOWN)).astype(np.uint8)
