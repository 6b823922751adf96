"""The squared distance to the nearest blocked cell of a window, exact and kept up to date."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.columns import Columns, layer_bits
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

BLOCK_ROWS = 8
"""Rows along y that are recomputed together; fewer cost more calls, more cost idle work."""

CACHE_LINE = 64  # bytes

ALL_ONES = (1 << 64) - 1
"""Flips of words whose set bits are the cells that are not blocked."""


class DistanceField:
    """Squared distances in cells to the nearest blocked cell, at most reach^2.

    The squared distance is a sum over the axes, so one exact pass per axis finds it (Felzenszwalb &
    Huttenlocher 2012, "Distance transforms of sampled functions"); truncated, a pass looks only
    `reach` cells around and works on whole rows at once. The distances within planes of constant x
    are kept, so that an update recomputes only the blocks of rows that a changed column can reach;
    the result is the same as of a new field. Space outside the window is blocked, except along an
    axis of one cell, which is no axis.

    Attributes:
        shape: (nx, ny, nz) cells.
        reach: Truncation of the distances, cells.
        squared: (nx, ny, nz) uint16, squared distances in cells. Others only read it.
    """

    def __init__(self, shape: tuple[int, int, int], reach: int) -> None:
        """Make the field of a window without blocked cells; the first update computes all of it.

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
        inside = layer_bits(0, nz, nz)  # of a column
        words = len(inside)
        self._layout = FieldLayout(self.shape, reach, self._block_rows, words)
        # More planes than there are: those outside hold nothing.
        planes = nx + 2 * planes_around(reach)
        squared = _on_cache_lines(blocks * units * planes * UNIT)
        squared[:] = most
        last = squared.reshape(blocks, units, planes, UNIT)[:, -1, :, cells % UNIT or UNIT :]
        last[:] = 0  # no cells: never the farthest
        self._sections = Sections(
            blocked=np.zeros((nx, ny * words), np.uint64),
            inside=np.tile(inside, self._block_rows),
            along_z=np.full(nx * blocks * cells, reach, np.uint8),
            holds_any=np.zeros((nx, blocks), np.bool_),
            squared=squared,
            nearest=np.full((blocks, units, planes), most, np.uint16),
            farthest=np.full((nx, blocks), most, np.uint16),
            least_bound=np.full((blocks, nx), FAR, np.uint16),
        )
        farthest = np.full((blocks, nx), most, np.uint16)
        stale = np.ones((blocks, nx), np.bool_)
        self._field = edt_field.Field(self.squared.reshape(-1), farthest, stale)

    def update(
        self,
        cells: NDArray[np.uint64],
        x0: int = 0,
        y0: int = 0,
        flip: int = 0,
        part: Columns | None = None,
    ) -> None:
        """Take over the cells of a box of columns, and bring the distances up to date.

        Args:
            cells: (kx, ky, words) bits: bit k of word w is cell 64 w + k along z. Bits beyond the
                window are not looked at.
            x0: Index of the first column along x.
            y0: Index of the first column along y.
            flip: `ALL_ONES` where the bits are the cells not blocked, else 0.
            part: Columns of the box; none outside changed; None for all.

        Raises:
            ValueError: The box is not within the window.
        """
        cells = np.ascontiguousarray(cells)  # or all is compiled again
        kx, ky, words = cells.shape
        (nx, ny, _), expected = self.shape, self._layout.words
        if x0 < 0 or y0 < 0 or x0 + kx > nx or y0 + ky > ny or words != expected:
            raise ValueError(
                f"cells: got {cells.shape} at ({x0}, {y0}), expected within {(nx, ny, expected)}"
            )
        planes, rows = (slice(0, kx), slice(0, ky)) if part is None else part
        within = (rows.start, rows.stop), (x0, y0)
        new = NewCells(cells.reshape(kx, -1), *within, np.uint64(flip))
        self._update_sections((x0 + planes.start, x0 + planes.stop), new)
        self._update_field()

    def _update_sections(self, planes: tuple[int, int], new: NewCells) -> None:
        """Take over new cells of planes, and recompute the blocks of sections that they change."""
        blocks, block_rows, nz = self._blocks, self._block_rows, self.shape[2]
        around, cells = edt_sections.blocks_around(self.reach, block_rows), block_rows * nz
        pitch = -(-(nz + self.reach) // 8) * 8  # cells, in whole words
        lines = np.empty((2, 2 * edt_sections.LONGEST_STEP + block_rows * pitch), np.uint8)
        scratch = edt_sections.SectionScratch(
            changes=np.empty((blocks, 2), np.int64),
            pending=np.empty(blocks, np.bool_),
            lines=lines,
            eights=lines.view(np.uint64),
            along_z=np.empty((blocks + 2 * around) * cells, np.uint16),
            plane_of=np.empty(blocks, np.int64),
            block=np.empty(cells, np.uint16),
        )
        edt_sections.update_sections(planes, new, self._layout, self._sections, scratch)

    def _update_field(self) -> None:
        """Recompute the blocks of the field that the sections' changes reach."""
        _, farthest, stale = self._field
        reached = np.empty(self.shape[0], np.uint16)
        bound = self._sections.least_bound
        edt_changes.find_stale(self.reach, farthest, bound, stale, reached)
        scratch = edt_field.FieldScratch(
            block=_on_cache_lines(edt_field.PLANES * self._units * UNIT),
            bounds=_on_cache_lines(self._units * UNIT),
            limits=np.empty(edt_field.PLANES, np.uint16),
        )
        edt_field.update_field(self._layout, self._sections, self._field, scratch)


def _on_cache_lines(cells: int) -> NDArray[np.uint16]:
    """Return an array (cells,) that begins where a cache line does.

    A vector of 64 bytes that lies in two lines is read twice: a seventh of a pass along x.
    """
    spare = CACHE_LINE // 2
    array = np.empty(cells + spare, np.uint16)
    first = -array.ctypes.data % CACHE_LINE // 2
    return array[first : first + cells]
