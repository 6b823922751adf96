"""Projections of a map for one body: the cells of its altitudes, or the columns it walks over."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.maps.columns import WORD_BITS, ColumnMap, Columns, Window, layer_bits
from wayproof.maps.costmap.blockers import Band, Blocker, blocker_in
from wayproof.maps.kernels import columns as kernels
from wayproof.maps.kernels import labels

ROUNDING = 1e-6
"""Part of a cell by which rounding may miss a whole number."""


class Projection:
    """The occupied and the free cells that one body meets, kept up to date with a map.

    Attributes:
        shape: (nx, ny, nz) cells; nz is 1 on the ground.
        origin: (3,) corner of the first cell, m, world.
        rows: (rows_x, rows_y, cells) the same cells in rows of bits: of z in the air; on the
            ground, where a column is one cell, of y.
        occupied: (rows_x, rows_y, words) bits.
        free: (rows_x, rows_y, words) bits; what is neither is unknown.
    """

    shape: tuple[int, int, int]
    origin: NDArray[np.float64]
    rows: tuple[int, int, int]

    def __init__(self, window: Window) -> None:
        """Start with all cells unknown."""
        self._window = window
        nx, ny, layers = window.shape
        self._words = -(-layers // WORD_BITS)
        self._held = np.zeros((2, nx, ny, self._words), np.uint64)  # occupied and free, along z
        self._stamp = 0  # of the map, when it was last looked at
        self.occupied = np.zeros((*self.rows[:2], -(-self.rows[2] // WORD_BITS)), np.uint64)
        self.free = np.zeros_like(self.occupied)

    def stand_at(self, feet: ArrayLike) -> None:
        """Learn where the body's feet (3,) are, m, world: only terrain depends on it."""

    def read(self, voxel_map: ColumnMap) -> Columns | None:
        """Take over the cells of a map that changed since the last time.

        Returns:
            The columns of words that it may have changed; None if there are none.
        """
        boxes, self._stamp = voxel_map.changed(self._stamp)
        # The words of its columns may hold layers that the window does not.
        boxes, box = self._window.touched_by(boxes)
        if box is None:
            return None
        voxel_map.rewrite_columns(self._window.first, boxes, self._held[0], self._held[1])
        box = self._affected(*box)
        return self._take(voxel_map.keep_out(*self._part(*box)), *box)

    def read_whole(self, voxel_map: ColumnMap) -> None:
        """Take over all cells of a map once, changed or not."""
        first, (nx, ny, _) = self._window.first, self._window.shape
        end = [first[0] + nx, first[1] + ny, first[2] + WORD_BITS * self._words]
        whole = np.array([[*first, *end]], np.int64)
        box = slice(0, nx), slice(0, ny)
        voxel_map.rewrite_columns(first, whole, self._held[0], self._held[1])
        self._take(voxel_map.keep_out(*self._part(*box)), *box)

    def blocker(self, voxel_map: ColumnMap, x: int, y: int, z: int, occupied: bool) -> Blocker:
        """Return the cell of the map for which a cell that is not free blocks."""
        return blocker_in(voxel_map, self._window, x, y, self._band(x, y, z), occupied)

    def _band(self, x: int, y: int, z: int) -> Band:
        """Return the layers of the map that make up a cell."""
        raise NotImplementedError

    def _affected(self, x: slice, y: slice) -> Columns:
        """Return the columns whose projection may change with a box of columns of the map."""
        return x, y

    def _part(self, x: slice, y: slice) -> tuple[tuple[int, int, int], tuple[int, int, int]]:
        """Return the least cell and size (nx, ny, words) of a box of columns."""
        first_x, first_y, first_z = self._window.first
        shape = x.stop - x.start, y.stop - y.start, self._words
        return (first_x + x.start, first_y + y.start, first_z), shape

    def _take(self, blocked: NDArray[np.uint64] | None, x: slice, y: slice) -> Columns:
        """Take over a box of the columns held, and of cells to keep out of, if there are any."""
        raise NotImplementedError


class Airspace(Projection):
    """The cells that lie wholly between two altitudes, as they are."""

    def __init__(self, window: Window, floor: float, ceiling: float) -> None:
        """Choose the layers.

        Args:
            window: The cells of the map that count.
            floor: Lowest altitude, m, world.
            ceiling: Highest altitude, m, world.

        Raises:
            ValueError: No layer of the window lies between them.
        """
        bottom, layers = window.origin[2], window.shape[2]
        top = bottom + layers * window.resolution
        low, high = max(floor, bottom), min(ceiling, top)
        first = math.ceil((low - bottom) / window.resolution - ROUNDING)
        end = math.floor((high - bottom) / window.resolution + ROUNDING)
        if first >= end:
            raise ValueError(
                f"floor, ceiling: got {floor:g} to {ceiling:g}, "
                f"expected a layer of the window within them ({bottom:g} to {top:g} m)"
            )
        self.shape = self.rows = (*window.shape[:2], end - first)
        self.origin = window.origin + np.array([0.0, 0.0, first * window.resolution])
        super().__init__(window.layers(first, end))
        self.occupied, self.free = self._held  # as they are

    def _band(self, x: int, y: int, z: int) -> Band:
        return Band(z, z, z + 1)

    def _take(self, blocked: NDArray[np.uint64] | None, x: slice, y: slice) -> Columns:
        if blocked is not None:
            self.occupied[x, y] |= blocked
            self.free[x, y] &= ~blocked
        return x, y


class Ground(Projection):
    """The columns of cells that a body on the floor z = 0 walks over, each as one cell.

    A column is occupied if something stands between the step height and the body's height, or if a
    beam went through where the floor should be; it is free if all of that band is free and a floor
    was seen below; else unknown. Obstacles above the body do not count.

    Floor that was seen holds where beams went below it, since lost echoes look so. It does not
    beside a column without floor, as at the edge of a dock.
    """

    def __init__(self, window: Window, height: float, step_height: float) -> None:
        """Choose the layers: under the floor, to stand on, and to pass through.

        Args:
            window: The cells of the map that count.
            height: Height of the body's back above the floor, m.
            step_height: Greatest height that the body can step on, m above the floor.

        Raises:
            ValueError: The body does not fit the window.
        """
        floor_layer, first, end = walking_layers(window, height, step_height)
        nx, ny, _ = window.shape
        self.shape, self.rows = (nx, ny, 1), (nx, 1, ny)
        self.origin = window.origin + np.array([0.0, 0.0, first * window.resolution])
        self._floor, self._first, self._layers = floor_layer, first, end - first
        self._flat_layers = kernels.FlatLayers(
            below=layer_bits(0, floor_layer, end),
            footing=layer_bits(floor_layer, first, end),
            band=layer_bits(first, end, end),
        )
        super().__init__(window.layers(0, end))

    def _band(self, x: int, y: int, z: int) -> Band:
        return Band(self._floor, self._first, self._first + self._layers)

    def _affected(self, x: slice, y: slice) -> Columns:
        nx, ny, _ = self.shape  # a column may be the edge of the hole beside it
        return (
            slice(max(x.start - 1, 0), min(x.stop + 1, nx)),
            slice(max(y.start - 1, 0), min(y.stop + 1, ny)),
        )

    def _take(self, blocked: NDArray[np.uint64] | None, x: slice, y: slice) -> Columns:
        kernels.project_columns(
            self._held[0],
            self._held[1],
            self._flat_layers,
            (x.start, x.stop),
            (y.start, y.stop),
            self.occupied[:, 0],
            self.free[:, 0],
        )
        if blocked is not None:
            first = np.full(blocked.shape[:2], self._first, np.int16)
            labels.block_columns(
                blocked,
                first,
                self._layers,
                x.start,
                y.start,
                self.occupied[:, 0],
                self.free[:, 0],
            )
        return x, slice(0, 1)


def walking_layers(window: Window, height: float, step_height: float) -> tuple[int, int, int]:
    """Return the layers of the floor, of the lowest cell that a body meets, and past its back.

    Raises:
        ValueError: The body does not fit the window.
    """
    if not 0.0 <= step_height < height:
        raise ValueError(
            f"step_height: got {step_height:g}, expected 0 to below the height, {height:g} m"
        )
    bottom, layers, floor_layer = window.origin[2], window.shape[2], window.floor_layer
    first = math.floor((step_height - bottom) / window.resolution + ROUNDING)
    end = math.ceil((height - bottom) / window.resolution - ROUNDING)
    if not 0 <= floor_layer < first:
        raise ValueError(
            f"step_height: got {step_height:g} m with cells of {window.resolution:g} m, expected "
            "smaller cells: the floor and what is above a step need layers of their own"
        )
    if end > layers:
        top = bottom + layers * window.resolution
        raise ValueError(f"height: got {height:g}, expected up to the window's top, {top:g} m")
    return floor_layer, first, end
