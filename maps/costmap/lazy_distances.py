"""Lazy distances: squared distances that are computed where they are read, and nowhere else."""

from __future__ import annotations

import time
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.costmap.distance_field import (
    ALL_ONES,
    BLOCK_ROWS,
    CellUpdate,
    DistanceField,
)
from wayproof.maps.kernels.lazy_distances import dilate, write_optimistic

Cells = NDArray[np.uint16]
Blocks = NDArray[np.bool_]
Words = NDArray[np.uint64]

ROUNDS = 2
"""Rounds of a decision after which all distances are brought up to date."""

AROUND = 2, 16
"""Blocks and planes beside where the last search looked, brought up to date for the next one: of
60 searches in `warehouse` at 5 cm 28 looked at something stale with 0 and 0, 13 with these."""


class Source(Protocol):
    """Squared distances with a record of which of them are out of date."""

    squared: Cells
    stale: Blocks

    def bring_up_to_date(self, blocks: Blocks | None = None) -> None:
        """Compute the distances of some blocks, or of all."""


class Reader:
    """The blocks of a source that were read.

    Attributes:
        read_blocks: (blocks, nx) as of `Distances`.
        searched: (blocks, nx) as of `Distances`.
        missed: Whether a block was read while it was stale, and has been computed since.
    """

    def __init__(self, source: Source) -> None:
        """Start without any block read."""
        self._source = source
        self.read_blocks = np.zeros_like(source.stale)
        self.searched = np.zeros_like(source.stale)
        self.missed = False

    def outdated(self) -> bool:
        """Return whether any block that was read is stale."""
        return bool(((self.read_blocks | self.searched) & self._source.stale).any())


class Distances:
    """Squared distances of a window, for a reader that marks the blocks that it reads.

    A reader works with `cells` as they are and marks the blocks that it reads. Then it calls
    `catch_up`: if any of these was stale, it is computed then, and the reader starts over. So the
    final result rests on up-to-date distances alone, and most of a window is never computed.

    A nested reader that starts over by itself refreshes blocks that its caller has already read;
    the caller must start over as well: see `latch_stale_reads`. All hold until the next update of
    the window.

    Attributes:
        cells: (nx, ny, nz) uint16, squared distances in cells, wherever they are not stale.
        read_blocks: (blocks, nx) blocks that were read: cell (i, j, k) lies in
            [j // BLOCK_ROWS, i]. The reader sets them.
        searched: (blocks, nx) blocks that a search read, which does not run at every update.
        reader: Record of these blocks.
        spent_s: Wall time of the computations since `begin`, s, for the record alone.
    """

    def __init__(
        self,
        source: Source,
        shape: tuple[int, int, int],
        readers: list[Reader] | None = None,
        searched_before: Blocks | None = None,
    ) -> None:
        """Read a source.

        Args:
            source: Source of one window.
            shape: (nx, ny, nz) of `cells`.
            readers: Readers of all distances of the window, to which this one adds its own; None
                where there are no others.
            searched_before: (blocks, nx) blocks that the last search in any of them read.
        """
        self._source = source
        self.reader = Reader(source)
        self._readers = [] if readers is None else readers
        self._readers.append(self.reader)
        if searched_before is None:
            searched_before = np.zeros_like(source.stale)
        self._searched_before = searched_before
        self.cells = source.squared.reshape(shape)
        self.read_blocks, self.searched = self.reader.read_blocks, self.reader.searched
        self.spent_s = 0.0
        self._rounds = 0

    def begin(self) -> None:
        """Bring up to date the blocks read since the last call, and forget that they were read."""
        if self.read_blocks.any():
            self._source.bring_up_to_date(self.read_blocks)
        self.read_blocks[:] = False
        self.searched[:] = False
        self.reader.missed, self.spent_s, self._rounds = False, 0.0, 0

    def outdated(self) -> bool:
        """Return whether any block that was read is stale."""
        return self.reader.outdated()

    def latch_stale_reads(self) -> None:
        """Latch stale reads so far, here and in all distances of the window.

        To be called before a nested reader refreshes blocks, after which no trace of it is left.
        """
        for reader in self._readers:
            reader.missed |= reader.outdated()

    def begin_search(self) -> bool:
        """Bring up to date the blocks that the last search read: this one will read them, too.

        Returns:
            Whether the search may begin; not if what was read before it is outdated.
        """
        if self.outdated():
            return False
        around = None  # for the first search: one among outdated distances leads anywhere
        if self._searched_before.any():
            around = np.empty_like(self.searched)
            dilate(self._searched_before, *AROUND, around)
        self._compute(around)
        return True

    def catch_up(self) -> bool:
        """Bring up to date the blocks that were read; return whether any was stale."""
        if not self.outdated():
            return False
        self._rounds += 1
        known = self.reader.missed
        read = self.read_blocks | self.searched
        self._compute(read if self._rounds <= ROUNDS else None)
        self.reader.missed = known  # the reader begins anew
        return True

    def whole(self) -> Cells:
        """Return all distances, up to date."""
        if self._source.stale.any():
            self._compute(None)
        return self.cells

    def _compute(self, blocks: Blocks | None) -> None:
        began = time.perf_counter()
        self.latch_stale_reads()
        self._source.bring_up_to_date(blocks)
        self.spent_s += time.perf_counter() - began


class OptimisticDistances:
    """Distances to one kind of cells, at most an edge where the other kind is nearer than that.

    Attributes:
        squared: (nx, ny, nz) uint16, wherever they are not stale.
        stale: (blocks, nx) which blocks of rows may be out of date.
    """

    def __init__(self, field: DistanceField, other: DistanceField, edge: int, most: int) -> None:
        """Combine two fields of one window.

        Args:
            field: The distances.
            other: Distances that bound them where less than the edge; unused at an edge of 0.
            edge: Squared distance, cells^2.
            most: Greatest squared distance, cells^2; farther cells have it too.
        """
        self._fields = field, other
        self.squared = np.empty(field.shape, np.uint16)
        self.stale = np.empty_like(field.stale)
        self.limit(edge, most)

    def limit(self, edge: int, most: int) -> None:
        """Set the limits, and compute all distances from the fields as they are."""
        self._limits = edge, most
        field, other = self._fields
        np.logical_or(field.stale, other.stale, out=self.stale)
        self._compute(np.ones_like(self.stale))

    def note_stale(self) -> None:
        """Mark as stale all that is stale in one of the fields."""
        for field in self._fields:
            self.stale |= field.stale

    def bring_up_to_date(self, blocks: Blocks | None = None) -> None:
        """Compute the distances in some blocks, or in all."""
        chosen = self.stale.copy() if blocks is None else self.stale & blocks
        if chosen.any():
            for field in self._fields:
                field.bring_up_to_date(chosen)
            self._compute(chosen)
            self.stale &= ~chosen

    def _compute(self, blocks: Blocks) -> None:
        """Compute blocks from the fields as they are."""
        own, others = (field.squared.reshape(-1) for field in self._fields)
        flat = self.squared.reshape(-1)
        write_optimistic(self._fields[0].shape, BLOCK_ROWS, blocks, own, others, self._limits, flat)


class Clearances:
    """Distances of one window to cells that are not free and to obstacles, plain and optimistic.

    Attributes:
        reach: Truncation of the distances, cells.
    """

    def __init__(self, rows: tuple[int, int, int], shape: tuple[int, int, int], reach: int) -> None:
        """Keep the distances of a window (nx, ny, nz), laid out in rows of another shape."""
        self.reach = reach
        self._shape = shape
        self._fields = DistanceField(rows, reach), DistanceField(rows, reach)
        self._all: list[Distances] = []
        self._readers: list[Reader] = []
        self._searched_before = np.zeros_like(self._fields[0].stale)
        self._plain = [self._distances(field) for field in self._fields]
        self._optimistic: dict[tuple[int, int, int], tuple[OptimisticDistances, Distances]] = {}
        self._in_use: set[tuple[int, int, int]] = set()

    def take_over(
        self, free: Words, occupied: Words, x: slice, y: slice, whole: bool = True
    ) -> None:
        """Take over a box of the columns (nx, ny, words) of the window.

        Args:
            free: (nx, ny, words) bits of free cells.
            occupied: (nx, ny, words) bits of occupied cells.
            x: First and one past the last plane of the box.
            y: First and one past the last row of the box.
            whole: Whether `begin` will bring all up to date.
        """
        box = (x.start, x.stop), (y.start, y.stop)
        not_free, obstacles = self._fields
        not_free.take_over(CellUpdate(free, ALL_ONES, (0, 0), *box), whole)
        obstacles.take_over(CellUpdate(occupied, 0, (0, 0), *box), whole)
        for optimistic, _ in self._optimistic.values():
            optimistic.note_stale()

    def begin(self, whole: bool) -> None:
        """Bring up to date both distances, or only the blocks read since the last call.

        Optimistic distances that were not used since then are dropped.
        """
        if whole:
            for field in self._fields:
                field.bring_up_to_date()
        searched = np.logical_or.reduce([distances.searched for distances in self._all])
        if searched.any():
            self._searched_before[:] = searched
        self._optimistic = {key: self._optimistic[key] for key in sorted(self._in_use)}
        self._all = [*(one for _, one in self._optimistic.values()), *self._plain]
        self._readers[:] = [distances.reader for distances in self._all]
        self._in_use.clear()
        for distances in self._all:
            distances.begin()

    def to_not_free(self, most: int) -> Distances:
        """Return those to the nearest cell that is not free, at most a squared one, cells^2."""
        return self._distances_to(0, 0, most)

    def to_obstacles(self, most: int) -> Distances:
        """Return those to the nearest occupied cell, at most a squared one, cells^2."""
        return self._distances_to(1, 0, most)

    def optimistic(self, edge: int, most: int) -> Distances:
        """Return those to obstacles, at most an edge where a cell not free is nearer, cells^2."""
        return self._distances_to(1, edge, most)

    def catch_up(self) -> bool:
        """Bring up to date all blocks that were read; return whether any was stale when read."""
        outdated = [distances for distances in self._all if distances.outdated()]
        missed = any(reader.missed for reader in self._readers)
        for distances in outdated:
            distances.catch_up()
        for reader in self._readers:
            reader.missed = False
        return missed or bool(outdated)

    @property
    def spent_s(self) -> float:
        """Wall time of the computations since `begin`, s, for the record alone."""
        return sum(distances.spent_s for distances in self._all)

    def _distances_to(self, kind: int, edge: int, most: int) -> Distances:
        if edge == 0 and most >= self.reach * self.reach:
            return self._plain[kind]
        key = kind, edge, most
        if key not in self._optimistic:
            self._optimistic[key] = self._make(*key)
        self._in_use.add(key)
        return self._optimistic[key][1]

    def _make(self, kind: int, edge: int, most: int) -> tuple[OptimisticDistances, Distances]:
        """Give distances that are not in use these limits, or make new ones."""
        kept = (key for key in self._optimistic if key[0] == kind)
        idle = min((key for key in kept if key not in self._in_use), default=None)
        if idle is None:
            optimistic = OptimisticDistances(self._fields[kind], self._fields[1 - kind], edge, most)
            return optimistic, self._distances(optimistic)
        optimistic, distances = self._optimistic.pop(idle)
        optimistic.limit(edge, most)
        return optimistic, distances

    def _distances(self, source: Source) -> Distances:
        distances = Distances(source, self._shape, self._readers, self._searched_before)
        self._all.append(distances)
        return distances
