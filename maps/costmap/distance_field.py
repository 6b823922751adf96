"""The squared distance to the nearest blocked cell of a window, exact and kept up to date."""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
from wayproof.maps.kernels.work_queue import Queue, new_queue
from wayproof.maps.parallel import ThreadTeam

BLOCK_ROWS = 8
"""Rows along y that are recomputed together; fewer cost more calls, more cost idle work."""

CACHE_LINE = 64  # bytes

PLANE_US, BLOCK_US = 1.0, 0.5
"""About, to find the changes of a plane and to recompute a block, microseconds."""


ALL_ONES = (1 << 64) - 1
"""Flips of words whose set bits are the cells that are not blocked."""


class CellUpdate(NamedTuple):
    """New cells of columns, for one field or several of a window.

    Attributes:
        cells: For each field (kx, ky, words): bit k of word w is cell 64 w + k along z.
        flips: For each field `ALL_ONES` where the bits are the cells not blocked, else 0.
        corner: Place of their first column in the window, along x and y.
        planes: First and one past the last plane that may have changed, along x, from the corner.
        rows: First and one past the last row that may have changed, along y, from the corner.
    """

    cells: tuple[NDArray[np.uint64], ...]
    flips: tuple[int, ...]
    corner: tuple[int, int]
    planes: tuple[int, int]
    rows: tuple[int, int]


NO_UPDATE = CellUpdate((np.zeros((1, 1, 1), np.uint64),), (0,), (0, 0), (0, 0), (0, 0))
"""An update without new cells."""


def boxes(blocked: Sequence[NDArray[np.uint64]], x0: int = 0, y0: int = 0) -> CellUpdate:
    """Return the blocked cells of a box of columns (kx, ky, words) that begins at (x0, y0)."""
    cells = tuple(np.ascontiguousarray(one) for one in blocked)  # or all is compiled anew
    kx, ky = cells[0].shape[:2]
    return CellUpdate(cells, (0,) * len(cells), (x0, y0), (0, kx), (0, ky))


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
        team: Threads that share the work.
        stale: (blocks, nx) which blocks of rows may be out of date: block b of plane x holds the
            rows from `BLOCK_ROWS` b on. Others only read it.
        pending: (blocks, nx) the same of the sections, the distances within planes.
    """

    def __init__(
        self, shape: tuple[int, int, int], reach: int, team: ThreadTeam | None = None
    ) -> None:
        """Make the field of a window without blocked cells; all of it is stale.

        Args:
            shape: (nx, ny, nz) cells.
            reach: Truncation of the distances, cells.
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
        self.team = team or ThreadTeam(1)
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
        update_together([self], boxes([blocked], x0, y0))

    def bring_up_to_date(self, blocks: NDArray[np.bool_] | None = None) -> None:
        """Compute the distances of some blocks (blocks, nx) where they are stale, or of all."""
        bring_up_to_date([self], blocks)

    def check(self, update: CellUpdate, number: int) -> None:
        """Refuse new cells that are not all within the window.

        Raises:
            ValueError: They are not.
        """
        (nx, ny, _), words, (x0, y0) = self.shape, self._layout.words, update.corner
        kx, ky, got_words = got = update.cells[number].shape
        inside = x0 >= 0 and y0 >= 0 and x0 + kx <= nx and y0 + ky <= ny and got_words == words
        parts = (update.planes, kx), (update.rows, ky)
        if not inside or not all(0 <= first <= end <= count for (first, end), count in parts):
            raise ValueError(
                f"blocked: got {got} at ({x0}, {y0}), of these planes {update.planes} and rows "
                f"{update.rows}, expected within {(nx, ny, words)}"
            )

    def sections_needed(self, blocks: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return the outdated sections (blocks, nx) that blocks of the field depend on."""
        needed = np.empty_like(blocks)
        find_needed(blocks, self.pending, self.reach, needed)
        return needed

    def find_stale(self) -> None:
        """Mark the blocks as stale that the cells taken over may change."""
        reached = np.empty(self.shape[0], np.uint16)
        least_bound, farthest = self._sections.least_bound, self._field.farthest
        edt_changes.find_stale(self.reach, farthest, least_bound, self.stale, reached)

    def update_sections(
        self,
        queue: Queue,
        planes: NDArray[np.int64],
        needed: NDArray[np.bool_] | None,
        update: CellUpdate = NO_UPDATE,
        number: int = 0,
    ) -> None:
        """Take over new cells of planes, recompute the needed blocks of their sections, or both.

        One of the threads that take planes from the queue.
        """
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
        cells_new, flip = update.cells[number], np.uint64(update.flips[number])
        new = NewCells(cells_new.reshape(len(cells_new), -1), update.rows, update.corner, flip)
        edt_sections.update_sections(
            queue,
            self.team.size,
            planes,
            new,
            self._none_needed if needed is None else needed,
            self._layout,
            self._sections,
            scratch,
        )

    def update_rows(self, queue: Queue, blocks: NDArray[np.bool_]) -> None:
        """Recompute blocks (blocks, nx) where they are stale.

        One of the threads that take rows of blocks from the queue.
        """
        scratch = edt_field.FieldScratch(
            block=_on_cache_lines(edt_field.PLANES * self._units * UNIT),
            bounds=_on_cache_lines(self._units * UNIT),
            limits=np.empty(edt_field.PLANES, np.uint16),
        )
        edt_field.update_field(
            queue, self.team.size, blocks, self._layout, self._sections, self._field, scratch
        )


def _on_cache_lines(cells: int) -> NDArray[np.uint16]:
    """Return an array (cells,) that begins where a cache line does.

    A vector of 64 bytes that lies in two lines is read twice: a seventh of a pass along x.
    """
    spare = CACHE_LINE // 2
    array = np.empty(cells + spare, np.uint16)
    first = -array.ctypes.data % CACHE_LINE // 2
    return array[first : first + cells]


def take_over(fields: Sequence[DistanceField], update: CellUpdate, whole: bool = False) -> None:
    """Take new cells over into fields of one window, and note which distances they may change.

    Args:
        fields: All of one shape; the first one's team shares the work.
        update: The cells.
        whole: Whether all will be brought up to date next: distances within the planes that change
            are then worked out at once, while these are at hand.

    Raises:
        ValueError: They are not within the window.
    """
    for n, field in enumerate(fields):
        field.check(update, n)
    planes = update.corner[0] + np.arange(*update.planes)

    def take(field: DistanceField, number: int, queue: Queue) -> None:
        needed = field.pending if whole else None
        field.update_sections(queue, planes, needed, update, number)

    us = PLANE_US + len(fields[0].stale) * BLOCK_US * whole
    _in_turn(fields, take, len(fields) * len(planes) * us)
    for field in fields:
        field.find_stale()


def bring_up_to_date(
    fields: Sequence[DistanceField], blocks: NDArray[np.bool_] | None = None
) -> None:
    """Compute the distances of fields of one window where they are stale.

    Args:
        fields: All of one shape; the first one's team shares the work.
        blocks: (blocks, nx) which of them; None for all.
    """
    stale = [field.stale if blocks is None else field.stale & blocks for field in fields]
    counts = [int(np.count_nonzero(blocks)) for blocks in stale]
    if not any(counts):
        return
    _bring_sections_up_to_date(fields, stale, whole=blocks is None)
    _in_turn(
        fields,
        lambda field, number, queue: field.update_rows(queue, stale[number]),
        BLOCK_US * sum(counts),
    )


def _bring_sections_up_to_date(
    fields: Sequence[DistanceField], stale: Sequence[NDArray[np.bool_]], whole: bool
) -> None:
    """Compute the distances within planes that stale blocks depend on, or all outdated ones."""
    needed = [
        field.pending if whole else field.sections_needed(blocks)
        for field, blocks in zip(fields, stale, strict=True)
    ]
    count = sum(int(np.count_nonzero(blocks)) for blocks in needed)
    if count == 0:
        return
    planes = [np.flatnonzero(blocks.any(axis=0)) for blocks in needed]

    def update(field: DistanceField, number: int, queue: Queue) -> None:
        field.update_sections(queue, planes[number], needed[number])

    _in_turn(fields, update, BLOCK_US * count)


def update_together(fields: Sequence[DistanceField], update: CellUpdate) -> None:
    """Take over and bring up to date in common rounds of threads; see these methods."""
    take_over(fields, update, whole=True)
    bring_up_to_date(fields)


def _in_turn(
    fields: Sequence[DistanceField],
    work: Callable[[DistanceField, int, Queue], None],
    us: float,
) -> None:
    """Work on one field after the other with all threads, where that is worth sharing.

    Each takes planes or rows from the field's queue while it is in compiled code: it neither waits
    for Python in between nor for a thread that still has a large part to do.

    Args:
        fields: Fields of one window.
        work: Called with a field, its number and its queue.
        us: About the time that it takes one thread, microseconds.
    """
    queues = [new_queue() for _ in fields]

    def run_worker(_: int) -> None:
        for number, (field, queue) in enumerate(zip(fields, queues, strict=True)):
            work(field, number, queue)

    fields[0].team.run_all(run_worker, us)
