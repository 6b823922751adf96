"""The squared distance to the nearest blocked cell of a window, exact and kept up to date."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from maps import _field_kernels as kernels
from maps._field_kernels import MAX_REACH
from maps.columns import layer_bits
from maps.team import Team

BLOCK_ROWS = 8
"""Rows along y that are recomputed together; fewer cost more calls, more cost idle work."""

CACHE_LINE = 64  # bytes


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
        block_rows: Rows along y that are recomputed together.
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
        self._team = team or Team(1)
        self.block_rows = min(BLOCK_ROWS, ny)
        self._blocks, most = -(-ny // self.block_rows), reach * reach
        blocks, cells = self._blocks, self.block_rows * nz
        self._block_cells = -(-2 * cells // CACHE_LINE) * (CACHE_LINE // 2)  # in whole cache lines
        self.squared = np.empty(shape, np.uint16)
        self._inside = layer_bits(0, nz, nz)
        self._blocked = np.zeros((nx, ny, len(self._inside)), np.uint64)
        self._along_z = np.full(nx * blocks * cells, reach, np.uint8)
        self._holds_any = np.zeros((nx, blocks), np.bool_)
        # More planes than there are: those outside hold nothing.
        planes = nx + 2 * kernels.planes_around(reach)
        self._sections = _on_cache_lines(planes * blocks * self._block_cells)
        self._sections[:] = most
        self._sections.reshape(-1, self._block_cells)[:, cells:] = 0  # no cells: never the farthest
        self._nearest_in_section = np.full((blocks, planes), most, np.uint16)
        self._farthest_in_section = np.full((nx, blocks), most, np.uint16)
        self._farthest = np.full((blocks, nx), most, np.uint16)
        self._least_change = np.zeros((blocks, nx), np.uint16)  # all is to be computed
        self._renewed = np.ones((blocks, nx), np.bool_)
        self._update_field((0, blocks))

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
        update_together([self], [blocked], x0, y0)

    def take_renewed(self) -> NDArray[np.bool_]:
        """Which blocks of rows (blocks, nx) were recomputed since this was last called."""
        renewed, self._renewed = self._renewed, np.zeros_like(self._renewed)
        return renewed

    def check(self, blocked: NDArray[np.uint64], x0: int, y0: int) -> None:
        """Refuse a box of columns that is not within the window.

        Raises:
            ValueError: It is not.
        """
        nx, ny, words = self._blocked.shape
        kx, ky, got_words = blocked.shape
        if x0 < 0 or y0 < 0 or x0 + kx > nx or y0 + ky > ny or got_words != words:
            raise ValueError(
                f"blocked: got {blocked.shape} at ({x0}, {y0}), expected within {(nx, ny, words)}"
            )

    def _update_sections(
        self, part: tuple[int, int], blocked: NDArray[np.uint64], corner: tuple[int, int]
    ) -> None:
        """Take over some planes of a box of columns, and recompute their stale blocks."""
        blocks, cells = self._blocks, self.block_rows * self.shape[2]
        around = kernels.blocks_around(self.reach, self.block_rows)
        pitch = -(-(self.shape[2] + self.reach) // 8) * 8  # cells, in whole words
        work = np.empty((2, 2 * kernels.LONGEST_STEP + self.block_rows * pitch), np.uint8)
        kernels.update_sections(
            part,
            blocked,
            corner,
            self._inside,
            self.reach,
            self.shape[2],
            self.block_rows,
            self._block_cells,
            self._blocked,
            self._along_z,
            self._holds_any,
            self._sections,
            self._farthest_in_section,
            self._nearest_in_section,
            self._least_change,
            np.empty((blocks + 2 * around) * cells, np.uint16),
            work,
            work.view(np.uint64),
            np.empty(cells, np.uint16),
            np.empty((blocks, 2), np.int64),
            np.empty(blocks, np.bool_),
            np.empty(blocks, np.int64),
        )

    def _update_field(self, part: tuple[int, int]) -> None:
        """Recompute some rows of blocks where the changes of the sections reach."""
        kernels.update_field(
            part,
            self.shape,
            self._sections,
            self._nearest_in_section,
            self.reach,
            self.block_rows,
            self._least_change,
            self._farthest,
            self.squared.reshape(-1),
            self._renewed,
            _on_cache_lines(self._block_cells),
            np.empty(self._block_cells, np.uint16),
            np.empty(self.shape[0], np.uint16),
        )


def _on_cache_lines(cells: int) -> NDArray[np.uint16]:
    """An array (cells,) that begins where a cache line does.

    A vector of 64 bytes that lies in two lines is read twice: a seventh of a pass along x.
    """
    spare = CACHE_LINE // 2
    array = np.empty(cells + spare, np.uint16)
    first = -array.ctypes.data % CACHE_LINE // 2
    return array[first : first + cells]


def update_together(
    fields: Sequence[DistanceField],
    boxes: Sequence[NDArray[np.uint64]],
    x0: int = 0,
    y0: int = 0,
) -> None:
    """Update fields of one window in common rounds of threads, those of the first one's team.

    Args:
        fields: All of one shape.
        boxes: (kx, ky, words) for each field the blocked cells of one box of columns.
        x0: Index of its first column along x.
        y0: Index of its first column along y.

    Raises:
        ValueError: The box is not within the window.
    """
    for field, box in zip(fields, boxes, strict=True):
        field.check(box, x0, y0)
    # Another layout would be compiled anew.
    plain = [np.ascontiguousarray(box) for box in boxes]
    planes, blocks, team = len(plain[0]), fields[0]._blocks, fields[0]._team

    def sections(_: int, part: tuple[int, int]) -> None:
        for n, some in _shares(part, planes):
            fields[n]._update_sections(some, plain[n], (x0, y0))

    def field_blocks(_: int, part: tuple[int, int]) -> None:
        for n, some in _shares(part, blocks):
            fields[n]._update_field(some)

    team.share(sections, len(fields) * planes)
    team.share(field_blocks, len(fields) * blocks)


def _shares(part: tuple[int, int], each: int) -> Iterator[tuple[int, tuple[int, int]]]:
    """Whose items a part of all is, and which of them, where everyone has equally many."""
    first, end = part
    while first < end:
        owner, at = divmod(first, each)
        count = min(each - at, end - first)
        yield owner, (at, at + count)
        first += count
