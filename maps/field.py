"""The squared distance to the nearest blocked cell of a window, exact and kept up to date."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from maps import _field_kernels as kernels
from maps._field_kernels import MAX_REACH
from maps.columns import layer_bits
from maps.team import Team

BLOCK_ROWS = 8
"""Rows along y that are recomputed together; fewer cost more calls, more cost idle work."""

ROW_MULTIPLE = 4  # cells: blocks of eight rows in whole vectors of 256 bits


class DistanceField:
    """Squared distances in cells to the nearest blocked cell, at most reach^2.

    The squared distance is a sum over the axes, so one exact pass per axis finds it (Felzenszwalb &
    Huttenlocher 2012, "Distance transforms of sampled functions"); truncated, a pass looks only
    `reach` cells around and works on whole rows at once. The distances within planes of constant x
    are kept, so that an update recomputes only the blocks of rows that a changed column can reach,
    and hands on only what really changed: the result is the same as of a new field, always. What
    lies outside the window is blocked, except along an axis of one cell, which is no axis.

    Attributes:
        shape: (nx, ny, nz) cells.
        reach: Greatest distance that is told, cells.
        squared: (nx, ny, nz) uint16, squared distances in cells. Others only read it.
    """

    def __init__(self, shape: tuple[int, int, int], reach: int, team: Team | None = None) -> None:
        """Make the field of a window without blocked cells.

        Args:
            shape: (nx, ny, nz) cells.
            reach: Greatest distance that is told, cells.
            team: Threads that share the work; None for the caller's alone. The result does not
                depend on them.

        Raises:
            ValueError: The window is empty, or the reach is not within 1 to 181 cells.
        """
        if min(shape) < 1:
            raise ValueError(f"shape: got {shape}, expected 1 cell or more along each axis")
        if not 1 <= reach <= MAX_REACH:
            raise ValueError(f"reach: got {reach} cells, expected 1 to {MAX_REACH}")
        nx, ny, nz = self.shape = shape
        self.reach = reach
        self.squared = np.empty(shape, np.uint16)
        self._team = team or Team(1)
        self._block_rows = min(BLOCK_ROWS, ny)
        self._row_cells = -(-nz // ROW_MULTIPLE) * ROW_MULTIPLE
        blocks, most = -(-ny // self._block_rows), reach * reach
        self._inside = layer_bits(0, nz, nz)
        self._blocked = np.zeros((nx, ny, len(self._inside)), np.uint64)
        block_cells = self._block_rows * self._row_cells
        # One plane more than there are: it stands for those outside, which hold nothing.
        self._sections = np.full((nx + 1, blocks, block_cells), most, np.uint16)
        self._nearest_in_section = np.full((nx + 1, blocks), most, np.uint16)
        self._farthest_in_section = np.full((nx, blocks), most, np.uint16)
        self._farthest = np.full((nx, blocks), most, np.uint16)
        self._least_change = np.full((nx, blocks), kernels.NO_CHANGE, np.uint16)
        self._stale_sections = np.zeros((nx, blocks), np.bool_)
        self._stale = np.ones((nx, blocks), np.bool_)
        self._refresh()

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
        nx, ny, words = self._blocked.shape
        kx, ky, got_words = blocked.shape
        if x0 < 0 or y0 < 0 or x0 + kx > nx or y0 + ky > ny or got_words != words:
            raise ValueError(
                f"blocked: got {blocked.shape} at ({x0}, {y0}), expected within {(nx, ny, words)}"
            )
        kernels.note_changes(
            np.ascontiguousarray(blocked),  # another layout would be compiled anew
            x0,
            y0,
            self._inside,
            self.reach,
            self._block_rows,
            self._farthest_in_section,
            self._blocked,
            self._stale_sections,
        )
        self._refresh()

    def _refresh(self) -> None:
        """Recompute the stale sections, then what their changes reach."""
        planes = np.flatnonzero(self._stale_sections.any(axis=1))
        self._team.share(lambda _, part: self._update_sections(planes[slice(*part)]), len(planes))
        kernels.spread_changes(self._least_change, self.reach, self._farthest, self._stale)
        # Block by block along x: neighbours share most of the planes that they look at.
        blocks = np.ascontiguousarray(np.argwhere(self._stale.T))
        self._team.share(lambda _, part: self._update_field(blocks[slice(*part)]), len(blocks))
        self._stale[:] = False

    def _update_sections(self, planes: NDArray[np.int64]) -> None:
        _, blocks, cells = self._sections.shape
        around = kernels.blocks_around(self.reach, self._block_rows)
        line = 2 * kernels.LONGEST_STEP + self._block_rows * (self._row_cells + self.reach)
        kernels.update_sections(
            planes,
            self._blocked,
            self.reach,
            self.shape[2],
            self._block_rows,
            self._row_cells,
            self._stale_sections,
            self._sections,
            self._farthest_in_section,
            self._nearest_in_section,
            self._least_change,
            np.empty((blocks + 2 * around) * cells, np.uint16),
            np.empty((2, line), np.uint16),
            np.empty(cells, np.uint16),
            np.empty(blocks, np.bool_),
            np.empty(blocks, np.int64),
        )

    def _update_field(self, blocks: NDArray[np.int64]) -> None:
        kernels.update_field(
            blocks,
            self._sections,
            self._nearest_in_section,
            self.reach,
            self._block_rows,
            self._row_cells,
            self._farthest,
            self.squared,
            np.empty(self._sections.shape[2], np.uint16),
            np.empty(self.shape[2], np.uint16),
        )
