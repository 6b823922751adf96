"""States of the single cells around a path, and distances between them, by slow code.

It shares nothing with the costmap that decisions were made on, so that the audit and the check of
reasons hold these against something else.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.log.paths import Array, densely
from wayproof.harness.mission import Mission
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, Representation, states_in

Integers = NDArray[np.int64]
Mask = NDArray[np.bool_]

SPACING = 0.25
"""Of the points that a path is checked at, cells."""

SLIVER = 1e-7
"""Of rounding: a face that lies on a bound is on neither side of it, m."""

SHELL = 512
"""Cells that are looked at together, from each cell of a path."""

OUTSIDE = 3
"""State of a cell that lies outside of the operating area: as good as occupied."""

NAMES = {FREE: "free", UNKNOWN: "unknown", OCCUPIED: "occupied", OUTSIDE: "outside"}
"""Of the states, as reasons name them."""


@dataclass(frozen=True)
class Cells:
    """Cells around a path: squares of columns for a body that walks, cubes for one that flies.

    Attributes:
        states: (nx, ny) or (nx, ny, nz).
        corner: (2,) or (3,) least corner of the first one, m.
        size: Edge of one, m.
    """

    states: NDArray[np.uint8]
    corner: Array
    size: float

    @property
    def axes(self) -> int:
        """2 in the plane, 3 in space."""
        return self.states.ndim

    @property
    def occupied(self) -> Mask:
        """Which are occupied, or as good as that."""
        occupied: Mask = (self.states == OCCUPIED) | (self.states == OUTSIDE)
        return occupied

    @property
    def not_free(self) -> Mask:
        """Which are occupied, as good as that, or unknown."""
        not_free: Mask = self.states != FREE
        return not_free

    def wrong(self, unknown_blocks: bool) -> Mask:
        """Which the body may not overlap."""
        return self.not_free if unknown_blocks else self.occupied

    def clearances(self, unknown_blocks: bool) -> Array:
        """Distance of each centre to the nearest one that the body may not overlap, cells."""
        from scipy import ndimage

        wrong = np.pad(self.wrong(unknown_blocks), 1, constant_values=True)
        inner = (slice(1, -1),) * self.axes
        distances: Array = ndimage.distance_transform_edt(~wrong)[inner]
        return distances

    def of(self, points: Array) -> Integers:
        """The cells (n, 2 or 3) that points (n, 3), m, lie in."""
        cells = np.floor((points[:, : self.axes] - self.corner) / self.size)
        return cells.astype(np.int64)

    def touched(self, path: Array) -> Integers:
        """The cells of points of a path (n, 3), m, a quarter of a cell apart; each once."""
        return np.unique(self.of(densely(path, SPACING * self.size)), axis=0)

    def within(self, cells: Integers, wrong: Mask, reach: float) -> Mask:
        """Whether a wrong cell's centre lies within a reach, cells, of each cell's centre, (n,)."""
        offsets, _ = ball(self.axes, reach)
        flat = wrong.ravel()
        near = [flat[self._indices(cell[None], offsets)].any() for cell in cells]
        return np.array(near, np.bool_)

    def least_distance(self, cells: Integers, wrong: Mask, reach: float) -> float:
        """Least distance between the centre of one of some cells and that of a wrong one, cells.

        At most the reach.
        """
        offsets, squares = ball(self.axes, reach)
        flat = wrong.ravel()
        for first in range(0, len(offsets), SHELL):
            shell = slice(first, first + SHELL)
            met = flat[self._indices(cells, offsets[shell])].any(axis=0)
            if met.any():
                return math.sqrt(squares[shell][int(met.argmax())])
        return reach

    def near(self, cells: Integers, wrong: Mask, reach: float) -> Integers:
        """The wrong cells (m, axes) whose centres lie within a reach, cells, of one of some."""
        offsets, _ = ball(self.axes, reach)
        seen = np.zeros(wrong.size, np.bool_)
        for cell in cells:
            seen[self._indices(cell[None], offsets)] = True
        found: Integers = np.argwhere(wrong & seen.reshape(wrong.shape))
        return found

    def _indices(self, cells: Integers, offsets: Integers) -> Integers:
        """Of each cell (n,) moved by each offset (m,), in the flat array: (n, m)."""
        shape = self.states.shape
        strides = np.array([math.prod(shape[axis + 1 :]) for axis in range(self.axes)])
        here, there = (cells * strides).sum(axis=1), (offsets * strides).sum(axis=1)
        indices: Integers = here[:, None] + there[None]
        return indices


@lru_cache(maxsize=32)
def ball(axes: int, reach: float) -> tuple[Integers, Integers]:
    """Offsets (n, axes) to all cells whose centres lie within a reach, and their squares (n,).

    In cells, the nearest first.
    """
    steps = np.arange(-math.floor(reach), math.floor(reach) + 1)
    offsets = np.stack(np.meshgrid(*(axes * [steps])), axis=-1).reshape(-1, axes)
    squares = (offsets**2).sum(axis=1)
    order = np.argsort(squares, kind="stable")
    order = order[squares[order] <= reach * reach]
    return offsets[order], squares[order]


def cells_around(
    voxel_map: Representation, path: Array, reach: float, config: Config, mission: Mission
) -> Cells:
    """The cells within a reach, m, and two more, of a path (n, 3), m."""
    size, flat = voxel_map.resolution, mission.planar
    pad = reach + 3.0 * size
    low, high = path[:, :3].min(axis=0) - pad, path[:, :3].max(axis=0) + pad
    if flat:
        low[2], high[2] = mission.low[2] - size, mission.height + 2.0 * size
    first = np.floor(low / size + (0.0, 0.0, 0.75))
    end = np.ceil(high / size + (0.0, 0.0, 0.75))
    corner = (first - (0.0, 0.0, 0.75)) * size
    # Its corners are those of cells, so a quarter of a cell inwards the same cells are meant.
    states = states_in(
        voxel_map, corner + 0.25 * size, (end - (0.0, 0.0, 0.75)) * size - 0.25 * size
    )
    if flat:
        states, corner = columns(states, float(corner[2]), size, mission), corner[:2]
    return Cells(fenced(states, corner, size, config, mission), corner, size)


def fenced(
    states: NDArray[np.uint8], corner: Array, size: float, config: Config, mission: Mission
) -> NDArray[np.uint8]:
    """The states with `OUTSIDE` where a cell does not lie partly inside the operating area.

    In height it must lie wholly between the altitudes of the configuration.
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
    """What a walking body meets in each column (nx, ny)."""
    lower = bottom + np.arange(states.shape[2]) * size  # edge of each layer
    inside = lower + size > mission.low[2] + SLIVER
    below = inside & (lower + size <= SLIVER)
    floor = (lower + size > SLIVER) & (lower + size <= mission.step_height + SLIVER)
    band = (lower + size > mission.step_height + SLIVER) & (lower < mission.height - SLIVER)
    occupied, free = states == OCCUPIED, states == FREE
    blocked = occupied[:, :, band].any(axis=2) | free[:, :, below].any(axis=2)
    standing = occupied[:, :, floor].any(axis=2) & free[:, :, band].all(axis=2)
    return np.where(blocked, OCCUPIED, np.where(standing, FREE, UNKNOWN)).astype(np.uint8)
