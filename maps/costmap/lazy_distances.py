"""Squared distances that are worked out where somebody looks, and nowhere else."""

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
    bring_up_to_date,
    take_over,
)
from wayproof.maps.kernels.lazy_distances import dilate, write_optimistic
from wayproof.maps.parallel import ThreadTeam

Cells = NDArray[np.uint16]
Blocks = NDArray[np.bool_]
Words = NDArray[np.uint64]

ROUNDS = 2
"""Who still looks at something stale after so many rounds has everything brought up to date."""

AROUND = 2, 16
"""Blocks and planes beside where the last search looked, brought up to date for the next one: of
60 searches in `warehouse` at 5 cm 28 looked at something stale with 0 and 0, 13 with these."""

PRESUME_US = 0.15
"""About what it takes to presume a block, microseconds."""


class Source(Protocol):
    """What holds squared distances and knows which of them are out of date."""

    squared: Cells
    stale: Blocks

    def bring_up_to_date(self, wanted: Blocks | None = None) -> None:
        """Work out the distances of some blocks, or of all."""


class Reader:
    """Where somebody looked at what a source holds.

    Attributes:
        looked_at: (blocks, nx) as `Distances` tells it.
        searched: (blocks, nx) likewise.
        missed: Whether something was looked at while it was stale, and has been worked out since.
    """

    def __init__(self, source: Source) -> None:
        """Nobody has looked yet."""
        self._source = source
        self.looked_at = np.zeros_like(source.stale)
        self.searched = np.zeros_like(source.stale)
        self.missed = False

    def outdated(self) -> bool:
        """Whether any of what was looked at is stale."""
        return bool(((self.looked_at | self.searched) & self._source.stale).any())


class Distances:
    """The squared distances of a window, for one who says where it looks.

    A reader works with `cells` as they are and notes where it looked. Then it calls `catch_up`: if
    any of that was stale, it has been worked out by now and the reader begins anew. So what is told
    at last rests on up-to-date distances alone, and most of a window is never worked out.

    Who reads a part of what another reads, and begins anew by itself, works out what the other may
    have looked at before: see `note_missed`. They hold until the next update of the window.

    Attributes:
        cells: (nx, ny, nz) uint16, squared distances in cells, wherever they are not stale.
        looked_at: (blocks, nx) where cells were looked at: cell (i, j, k) lies in
            [j // BLOCK_ROWS, i]. A reader sets it.
        searched: (blocks, nx) the same, for who looks all around, but not at every update.
        reader: Who looked there.
        spent_s: Wall time that working out took since `begin`, for the record alone.
    """

    def __init__(
        self,
        source: Source,
        shape: tuple[int, int, int],
        readers: list[Reader] | None = None,
        searched_before: Blocks | None = None,
    ) -> None:
        """Tell what a source holds.

        Args:
            source: Of one window.
            shape: (nx, ny, nz) of the array that is told.
            readers: Of all distances of the window, to which this one adds its own; None where
                there are no others.
            searched_before: (blocks, nx) where the last search in any of them looked.
        """
        self._source = source
        self.reader = Reader(source)
        self._readers = [] if readers is None else readers
        self._readers.append(self.reader)
        if searched_before is None:
            searched_before = np.zeros_like(source.stale)
        self._searched_before = searched_before
        self.cells = source.squared.reshape(shape)
        self.looked_at, self.searched = self.reader.looked_at, self.reader.searched
        self.spent_s = 0.0
        self._rounds = 0

    def begin(self) -> None:
        """Bring up to date what was looked at of late, and forget who looked where."""
        if self.looked_at.any():
            self._source.bring_up_to_date(self.looked_at)
        self.looked_at[:] = False
        self.searched[:] = False
        self.reader.missed, self.spent_s, self._rounds = False, 0.0, 0

    def outdated(self) -> bool:
        """Whether any of what was looked at is stale."""
        return self.reader.outdated()

    def note_missed(self) -> None:
        """Note who looked at something stale so far, here and in all distances of the window.

        To be called before a part of a reader's work that catches up by itself, and done before
        anything is worked out: afterwards nothing tells that it was stale.
        """
        for reader in self._readers:
            reader.missed |= reader.outdated()

    def begin_search(self) -> bool:
        """Bring up to date where the last search looked: this one will look there, too.

        Returns:
            Whether the search may begin; not if it rests on something outdated already.
        """
        if self.outdated():
            return False
        around = None  # for the first search: one among outdated distances leads anywhere
        if self._searched_before.any():
            around = np.empty_like(self.searched)
            dilate(self._searched_before, *AROUND, around)
        self._work_out(around)
        return True

    def catch_up(self) -> bool:
        """Bring up to date what was looked at; whether any of it was stale."""
        if not self.outdated():
            return False
        self._rounds += 1
        known = self.reader.missed
        wanted = self.looked_at | self.searched
        self._work_out(wanted if self._rounds <= ROUNDS else None)
        self.reader.missed = known  # the reader begins anew
        return True

    def whole(self) -> Cells:
        """All of them, up to date."""
        if self._source.stale.any():
            self._work_out(None)
        return self.cells

    def _work_out(self, wanted: Blocks | None) -> None:
        began = time.perf_counter()
        self.note_missed()
        self._source.bring_up_to_date(wanted)
        self.spent_s += time.perf_counter() - began


class OptimisticDistances:
    """Distances to one kind of cells, at most an edge where the other kind is nearer than that.

    Attributes:
        squared: (nx, ny, nz) uint16, wherever they are not stale.
        stale: (blocks, nx) which blocks of rows may be out of date.
    """

    def __init__(self, field: DistanceField, other: DistanceField, edge: int, most: int) -> None:
        """Presume from two fields of one window.

        Args:
            field: What is told.
            other: What bounds it where less than the edge; at an edge of 0 it does not matter.
            edge: Squared distance, cells^2.
            most: Greatest squared distance that is told, cells^2.
        """
        self._fields = field, other
        self.squared = np.empty(field.shape, np.uint16)
        self.stale = np.empty_like(field.stale)
        self.limit(edge, most)

    def limit(self, edge: int, most: int) -> None:
        """Presume with these limits from now on: all of it anew, from the fields as they are."""
        self._limits = edge, most
        field, other = self._fields
        np.logical_or(field.stale, other.stale, out=self.stale)
        self._compute(np.ones_like(self.stale))

    def note_stale(self) -> None:
        """Note what is out of date because one of the fields is."""
        for field in self._fields:
            self.stale |= field.stale

    def bring_up_to_date(self, wanted: Blocks | None = None) -> None:
        """Work them out in some blocks, or in all."""
        blocks = self.stale.copy() if wanted is None else self.stale & wanted
        if blocks.any():
            bring_up_to_date(self._fields, blocks)
            self._compute(blocks)
            self.stale &= ~blocks

    def _compute(self, blocks: Blocks) -> None:
        """From the fields as they are."""
        shape, team = self._fields[0].shape, self._fields[0].team
        told, others = (field.squared.reshape(-1) for field in self._fields)
        flat = self.squared.reshape(-1)

        def work(_: int, part: tuple[int, int]) -> None:
            write_optimistic(part, shape, BLOCK_ROWS, blocks, told, others, self._limits, flat)

        item_us = PRESUME_US * np.count_nonzero(blocks) / len(blocks)
        team.parallel_for(work, len(blocks), item_us=item_us)


class Clearances:
    """Distances of one window to what is not free and to obstacles, and what is presumed of them.

    Attributes:
        reach: Greatest distance that can be told, cells.
    """

    def __init__(
        self, rows: tuple[int, int, int], shape: tuple[int, int, int], reach: int, team: ThreadTeam
    ) -> None:
        """Tell the distances of a window (nx, ny, nz), laid out in rows of a shape, as that one."""
        self.reach = reach
        self._shape = shape
        self._fields = DistanceField(rows, reach, team), DistanceField(rows, reach, team)
        self._all: list[Distances] = []
        self._readers: list[Reader] = []
        self._searched_before = np.zeros_like(self._fields[0].stale)
        self._plain = [self._distances(field) for field in self._fields]
        self._optimistic: dict[tuple[int, int, int], tuple[OptimisticDistances, Distances]] = {}
        self._asked_for: set[tuple[int, int, int]] = set()

    def take_over(
        self, free: Words, occupied: Words, x: slice, y: slice, whole: bool = True
    ) -> None:
        """Take over a box of the columns (nx, ny, words) of the window.

        Args:
            free: Which cells are, bit by bit.
            occupied: Which are.
            x: First and one past the last of the box.
            y: The same.
            whole: Whether `begin` will bring all up to date.
        """
        box = (x.start, x.stop), (y.start, y.stop)
        take_over(self._fields, CellUpdate((free, occupied), (ALL_ONES, 0), (0, 0), *box), whole)
        for optimistic, _ in self._optimistic.values():
            optimistic.note_stale()

    def begin(self, whole: bool) -> None:
        """Bring up to date both distances, or only what was looked at of late.

        What nobody asked for since the last time is presumed no more.
        """
        if whole:
            bring_up_to_date(self._fields)
        searched = np.logical_or.reduce([distances.searched for distances in self._all])
        if searched.any():
            self._searched_before[:] = searched
        self._optimistic = {asked: self._optimistic[asked] for asked in sorted(self._asked_for)}
        self._all = [*(one for _, one in self._optimistic.values()), *self._plain]
        self._readers[:] = [distances.reader for distances in self._all]
        self._asked_for.clear()
        for distances in self._all:
            distances.begin()

    def to_not_free(self, most: int) -> Distances:
        """To the nearest cell that is not free, at most a squared distance, cells^2."""
        return self._told(0, 0, most)

    def to_obstacles(self, most: int) -> Distances:
        """To the nearest cell that is occupied, at most a squared distance, cells^2."""
        return self._told(1, 0, most)

    def optimistic(self, edge: int, most: int) -> Distances:
        """To obstacles, where something not free is nearer than an edge at most that, cells^2."""
        return self._told(1, edge, most)

    def catch_up(self) -> bool:
        """Bring everything up to date where somebody looked; whether any of it was stale then."""
        outdated = [distances for distances in self._all if distances.outdated()]
        missed = any(reader.missed for reader in self._readers)
        for distances in outdated:
            distances.catch_up()
        for reader in self._readers:
            reader.missed = False
        return missed or bool(outdated)

    @property
    def spent_s(self) -> float:
        """Wall time that working out took since `begin`, for the record alone."""
        return sum(distances.spent_s for distances in self._all)

    def _told(self, kind: int, edge: int, most: int) -> Distances:
        if edge == 0 and most >= self.reach * self.reach:
            return self._plain[kind]
        asked = kind, edge, most
        if asked not in self._optimistic:
            self._optimistic[asked] = self._compute(*asked)
        self._asked_for.add(asked)
        return self._optimistic[asked][1]

    def _compute(self, kind: int, edge: int, most: int) -> tuple[OptimisticDistances, Distances]:
        """Distances that nobody asked for since the last update, with these limits; or new ones."""
        kept = (asked for asked in self._optimistic if asked[0] == kind)
        idle = min((asked for asked in kept if asked not in self._asked_for), default=None)
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
