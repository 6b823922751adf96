"""The projection of a map for a walking body where the ground rises and falls."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.maps.columns import ColumnMap, Columns, Window
from wayproof.maps.costmap.blockers import Band
from wayproof.maps.costmap.projection import ROUNDING, Ground, Projection, walking_layers
from wayproof.maps.elementary import tangent
from wayproof.maps.grid import cells_at, finite_vector
from wayproof.maps.kernels import labels
from wayproof.maps.kernels import terrain as kernels

BASELINE = 8
"""Distance over which a slope is measured, cells: over less it drowns in a cell's height."""

SLOPE_STEPS = 1 << 20
"""Steps to a tangent of 1: tangents are whole multiples of one step."""


class Terrain(Projection):
    """The columns of cells that a body walks over where it climbs ramps, each as one cell.

    Ground is the floor z = 0 where it is seen, the surfaces about the body's feet, and from there
    on, column by column, the lowest surface that has room for the body above it and differs from
    its neighbour's by no more than a ramp of `max_slope` and a step of `step_height` may. A column
    without such a surface is measured against the ground next to it. The states are those of
    `Ground`, with heights from the column's ground; and ground that falls by more than a ramp may,
    within 8 cells, is an obstacle.

    Heights are whole cells. A ramp of at most `max_slope` that is seen is never refused; to make
    sure of that, a step of up to one cell more than `step_height` may pass for a ramp. So steps are
    distinguished from ramps only where cells are no larger than the step in question.

    Attributes:
        ground: (nx, ny) layer of the window that the body stands on.
        seen: (nx, ny) whether a surface was seen there.
    """

    def __init__(self, window: Window, height: float, step_height: float, max_slope: float) -> None:
        """Choose the layers and the limits.

        Args:
            window: The cells of the map that count.
            height: Height of the body's back above the ground, m.
            step_height: Greatest height that the body can step on, m above the ground.
            max_slope: Steepest ramp, rad.

        Raises:
            ValueError: The body does not fit the window.
        """
        floor, first, end = walking_layers(window, height, step_height)
        nx, ny, _ = window.shape
        self.shape, self.rows = (nx, ny, 1), (nx, 1, ny)
        self.origin = window.origin + np.array([0.0, 0.0, first * window.resolution])
        super().__init__(window)
        self._body = kernels.Body(floor, foot=first - floor, tall=end - floor)
        self._rises = rises(step_height / window.resolution, max_slope)
        self._grown, self._margined = np.zeros((nx, ny, self._words), np.uint64), False
        self.ground = np.full((nx, ny), floor, np.int16)
        self.seen = np.zeros((nx, ny), np.bool_)
        self._feet = (0, 0, kernels.NOWHERE)
        self._stood = self._feet  # when it was last projected

    def stand_at(self, feet: ArrayLike) -> None:
        """Take the surfaces about the feet for ground too, from the next update on.

        Where the floor z = 0 is out of sight, what is ground cannot be found from there.

        Args:
            feet: (3,) on the ground below the body's centre, m, world.

        Raises:
            ValueError: They are not finite.
        """
        cell = cells_at(finite_vector("feet", feet)[None], self._window.resolution)[0][0]
        x, y, layer = (cell - self._window.first).tolist()
        self._feet = (x, y, max(layer, 0))

    def read(self, voxel_map: ColumnMap) -> Columns | None:
        """Take over changes of the map, and those by the body's place."""
        changed = super().read(voxel_map)
        if changed is not None or self._feet == self._stood:
            return changed
        return self._project()

    def _band(self, x: int, y: int, z: int) -> Band:
        _, foot, tall = self._body
        ground = int(self.ground[x, y])
        return Band(ground, ground + foot, ground + tall)

    def _take(self, blocked: NDArray[np.uint64] | None, x: slice, y: slice) -> Columns:
        if blocked is not None:
            self._grown[x, y], self._margined = blocked, True
        # One column that turns into ground may open a way to others far off.
        return self._project() or (slice(x.start, x.stop), slice(0, 1))

    def _project(self) -> Columns | None:
        """Find all columns again; return the rows that changed, if any did."""
        self._stood = self._feet
        new = np.zeros((2, *self.occupied[:, 0].shape), np.uint64)
        kernels.project_terrain(
            self._held[0],
            self._held[1],
            self._body,
            self._feet,
            self._rises,
            self.ground,
            self.seen,
            new[0],
            new[1],
        )
        if self._margined:
            _, foot, tall = self._body
            feet = (self.ground + foot).astype(np.int16)
            labels.block_columns(self._grown, feet, tall - foot, 0, 0, new[0], new[1])
        differ = (new[0] != self.occupied[:, 0]) | (new[1] != self.free[:, 0])
        rows = np.flatnonzero(differ.any(axis=1))
        self.occupied[:, 0], self.free[:, 0] = new
        return (slice(int(rows[0]), int(rows[-1]) + 1), slice(0, 1)) if len(rows) else None


def walked(window: Window, height: float, step_height: float, max_slope: float) -> Projection:
    """Make the projection for a walking body: flat ground if it climbs no ramps, else terrain.

    Raises:
        ValueError: The body does not fit the window.
    """
    if max_slope == 0.0:
        return Ground(window, height, step_height)
    return Terrain(window, height, step_height, max_slope)


def rises(step: float, max_slope: float) -> NDArray[np.int64]:
    """Return the greatest rise of layers between columns by their distance along axes, and across.

    Heights that differ by less than n cells lie at most n layers apart. A ramp is met anywhere in
    a column, so it counts from one's near side to the other's far side.

    Args:
        step: Greatest height that the body can step on, cells.
        max_slope: Steepest ramp, rad.

    Returns:
        (2, 9) layers for distances of 0 to 8 columns.
    """
    slope = round(tangent(max_slope) * SLOPE_STEPS) / SLOPE_STEPS
    distances = np.arange(BASELINE + 1.0)
    limits = []
    for length in (1.0, math.sqrt(2.0)):
        heights = np.maximum(step + slope * length * distances, slope * length * (distances + 1))
        limits.append(np.ceil(heights - ROUNDING))
    return np.array(limits).astype(np.int64)
