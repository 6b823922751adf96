"""The squared distance to the nearest blocked cell of a window, exact and kept up to date."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.columns import layer_bits
from wayproof.maps.kernels import edt_changes, edt_field, edt_sections
from wayproof.maps.kernels.edt import (
    FAR,
    MAX_REACH,
    UNIT,
    FieldLayout,
    NewCells,
    Sections,
    planes_around,
)
from wayproof.maps.kernels.lazy_distances import find_needed

BLOCK_ROWS = 8
"""Rows along y that are recomputed together; fewer cost more calls, more cost idle work."""

CACHE_LINE = 64  # bytes

ALL_ONES = (1 << 64) - 1
"""Flips of words whose set bits are the cells that are not blocked."""


class CellUpdate(NamedTuple):
    """New cells of columns.

    Attributes:
        cells: (kx, ky, words): bit k of word w is cell 64 w + k along z.
        flip: `ALL_ONES` where the bits are the cells not blocked, else 0.
        corner: Place of their first column in the window, along x and y.
        planes: First and one past the last plane that may have changed, along x, from the corner.
        rows: First and one past the last row that may have changed, along y, from the corner.
    """

    cells: NDArray[np.uint64]
    flip: int
    corner: tuple[int, int]
    planes: tuple[int, int]
    rows: tuple[int, int]


NO_UPDATE = CellUpdate(np.zeros((1, 1, 1), np.uint64), 0, (0, 0), (0, 0), (0, 0))
"""An update without new cells."""


class DistanceField:
    """Squared distances in cells to the nearest blocked cell, at most reach^2.

    The squared distance is a sum over the axes, so one exact pass per axis finds it (Felzenszwalb &
    Huttenlocher 2012, "Distance transforms of sampled functions"); truncated, a pass looks only
    `reach` cells around and works on whole rows at once. The distances within planes of constant x
    are kept, so that an update recomputes only the blocks of rows that a changed column can reach:
    wherever it is not stale, the result is the same as of a new field. Space outside the window is
    blocked, except along an axis of one cell, which is no axis.

    New cells can be taken over now, and distances computed later where they are needed: see
    `take_over` and `bring_up_to_date`.

    Attributes:
        shape: (nx, ny, nz) cells.
        reach: Truncation of the distances, cells.
        squared: (nx, ny, nz) uint16, squared distances in cells, wherever they are not stale.
            Others only read it.
        stale: (blocks, nx) which blocks of rows may be out of date: block b of plane x holds the
            rows from `BLOCK_ROWS` b on. Others only read it.
        pending: (blocks, nx) the same of the sections, the distances within planes.
    """

    def __init__(self, shape: tuple[int, int, int], reach: int) -> None:
        """Make the field of a window without blocked cells; all of it is stale.

        Args:
            shape: (nx, ny, nz) cells.
            reach: Truncation of the distances, cells.

        Raises:
            ValueError: The window is empty, or the reach is not within 1 to 181 cells.
        """
        if min(shape) < 1:
            raise ValueError(f"shape: got {shape}, expected 1 cell or more along each axis")
        if not 1 <= reach <= MAX_REACH:
            raise ValueError(f"reach: got {reach} cells, expected 1 to {MAX_REACH}")
        nx, ny, nz = self.shape = shape
        self.reach = reach
        self._block_rows = min(BLOCK_ROWS, ny)
        self._blocks, most = -(-ny // self._block_rows), reach * reach
        blocks, cells = self._blocks, self._block_rows * nz
        self._units = units = -(-cells // UNIT)
        self.squared = np.full(shape, most, np.uint16)
        self.stale = np.ones((blocks, nx), np.bool_)
        inside = layer_bits(0, nz, nz)  # of a column
        words = len(inside)
        self._layout = FieldLayout(self.shape, reach, self._block_rows, words)
        # More planes than there are: those outside hold nothing.
        planes = nx + 2 * planes_around(reach)
        squared = _on_cache_lines(blocks * units * planes * UNIT)
        squared[:] = most
        last = squared.reshape(blocks, units, planes, UNIT)[:, -1, :, cells % UNIT or UNIT :]
        last[:] = 0  # no cells: never the farthest
        self.pending = np.zeros((blocks, nx), np.bool_)
        self._sections = Sections(
            blocked=np.zeros((nx, ny * words), np.uint64),
            inside=np.tile(inside, self._block_rows),
            along_z=np.full(nx * blocks * cells, reach, np.uint8),
            unmeasured=np.zeros((nx, blocks), np.bool_),
            holds_any=np.zeros((nx, blocks), np.bool_),
            squared=squared,
            nearest=np.full((blocks, units, planes), most, np.uint16),
            farthest=np.full((nx, blocks), most, np.uint16),
            pending=self.pending,
            least_bound=np.full((blocks, nx), FAR, np.uint16),
        )
        farthest = np.full((blocks, nx), most, np.uint16)
        self._field = edt_field.Field(self.squared.reshape(-1), farthest, self.stale)
        self._none_needed = np.zeros((blocks, nx), np.bool_)

    def update(self, blocked: NDArray[np.uint64], x0: int = 0, y0: int = 0) -> None:
        """Take over the cells of a box of columns, and bring the distances up to date.

        Args:
            blocked: (kx, ky, words) blocked cells: bit k of word w is cell 64 w + k along z. Bits
                beyond the window are not looked at.
            x0: Index of the first column along x.
            y0: Index of the first column along y.

        Raises:
            ValueError: The box is not within the window.
        """
        cells = np.ascontiguousarray(blocked)  # or all is compiled anew
        kx, ky = cells.shape[:2]
        self.take_over(CellUpdate(cells, 0, (x0, y0), (0, kx), (0, ky)), whole=True)
        self.bring_up_to_date()

    def take_over(self, update: CellUpdate, whole: bool = False) -> None:
        """Take new cells over, and note which distances they may change.

        Args:
            update: The cells.
            whole: Whether all will be brought up to date next: distances within the planes that
                change are then worked out at once, while these are at hand.

        Raises:
            ValueError: They are not within the window.
        """
        self._check(update)
        planes = update.corner[0] + np.arange(*update.planes)
        self._update_sections(planes, self.pending if whole else self._none_needed, update)
        reached = np.empty(self.shape[0], np.uint16)
        least_bound, farthest = self._sections.least_bound, self._field.farthest
        edt_changes.find_stale(self.reach, farthest, least_bound, self.stale, reached)

    def bring_up_to_date(self, blocks: NDArray[np.bool_] | None = None) -> None:
        """Compute the distances of some blocks (blocks, nx) where they are stale, or of all."""
        stale = self.stale if blocks is None else self.stale & blocks
        if not stale.any():
            return
        needed = self.pending
        if blocks is not None:
            needed = np.empty_like(blocks)
            find_needed(stale, self.pending, self.reach, needed)
        planes = np.flatnonzero(needed.any(axis=0))
        if len(planes):
            self._update_sections(planes, needed, NO_UPDATE)
        scratch = edt_field.FieldScratch(
            block=_on_cache_lines(edt_field.PLANES * self._units * UNIT),
            bounds=_on_cache_lines(self._units * UNIT),
            limits=np.empty(edt_field.PLANES, np.uint16),
        )
        edt_field.update_field(stale, self._layout, self._sections, self._field, scratch)

    def _check(self, update: CellUpdate) -> None:
        """Refuse new cells that are not all within the window.

        Raises:
            ValueError: They are not.
        """
        (nx, ny, _), words, (x0, y0) = self.shape, self._layout.words, update.corner
        kx, ky, got_words = got = update.cells.shape
        inside = x0 >= 0 and y0 >= 0 and x0 + kx <= nx and y0 + ky <= ny and got_words == words
        parts = (update.planes, kx), (update.rows, ky)
        if not inside or not all(0 <= first <= end <= count for (first, end), count in parts):
            raise ValueError(
                f"blocked: got {got} at ({x0}, {y0}), of these planes {update.planes} and rows "
                f"{update.rows}, expected within {(nx, ny, words)}"
            )

    def _update_sections(
        self, planes: NDArray[np.int64], needed: NDArray[np.bool_], update: CellUpdate
    ) -> None:
        """Take over new cells of planes, and recompute the needed blocks of their sections."""
        blocks, block_rows, nz = self._blocks, self._block_rows, self.shape[2]
        around, cells = edt_sections.blocks_around(self.reach, block_rows), block_rows * nz
        pitch = -(-(nz + self.reach) // 8) * 8  # cells, in whole words
        lines = np.empty((2, 2 * edt_sections.LONGEST_STEP + block_rows * pitch), np.uint8)
        scratch = edt_sections.SectionScratch(
            changes=np.empty((blocks, 2), np.int64),
            lines=lines,
            eights=lines.view(np.uint64),
            along_z=np.empty((blocks + 2 * around) * cells, np.uint16),
            plane_of=np.empty(blocks, np.int64),
            block=np.empty(cells, np.uint16),
        )
        columns = update.cells.reshape(len(update.cells), -1)
        new = NewCells(columns, update.rows, update.corner, np.uint64(update.flip))
        edt_sections.update_sections(planes, new, needed, self._layout, self._sections, scratch)


def _on_cache_lines(cells: int) -> NDArray[np.uint16]:
    """Return an array (cells,) that begins where a cache line does.

    A vector of 64 bytes that lies in two lines is read twice: a seventh of a pass along x.
    """
    spare = CACHE_LINE // 2
    array = np.empty(cells + spare, np.uint16)
    first = -array.ctypes.data % CACHE_LINE // 2
    return array[first : first + cells]
