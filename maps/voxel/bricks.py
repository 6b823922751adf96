"""Bricks of voxels: log-odds of 16 x 16 x 64 cells each, held in a pool of fixed size."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.kernels import bricks as kernels
from wayproof.maps.kernels import update
from wayproof.maps.kernels.bricks import BELOW_FLOOR, EDGE, EDGE_BITS, HEIGHT
from wayproof.maps.kernels.decay import NEVER
from wayproof.maps.slot_pool import EVERYWHERE, MEBIBYTE, Layer, SlotPool
from wayproof.maps.states import FREE, OCCUPIED, STATE_NAMES

BYTES_IN_BRICK = kernels.COLUMNS * kernels.HEIGHT * 5 // 4 + 80

READY = 1024
"""Bricks whose memory is committed before the first sweep: 100,000 rays at 5 cm meet some 850 at
once. To commit it page by page takes half the time of a first sweep."""

RECORD = np.dtype([("key", "<i4", 3), ("ticks", "<i8"), ("lanes", "<u8", 8)])  # without gaps
"""Content of a brick that its digest hashes."""


class Bricks(SlotPool):
    """A pool of bricks, found by their index.

    Attributes:
        cells: (slots, 256, 64) int8, log-odds in units.
        eights: (slots, 256, 8) uint64, the same memory.
        fresh: (slots, 256) uint64, cells that were updated since the last tick.
        settled: (slots, 256) uint64, cells known to lie at the lower clamp.
        ticks: (slots,) decay ticks that the cells have seen.
        dues: (slots,) tick at which a brick has to be looked at.
        arrays: All of these, and some of the pool's, as the kernels take them.
    """

    def __init__(self, memory_mib: int) -> None:
        """Reserve a pool that takes at most `memory_mib`."""
        super().__init__(
            max(memory_mib * MEBIBYTE // BYTES_IN_BRICK, 1),
            {
                "cells": Layer(np.int8, (kernels.COLUMNS, kernels.HEIGHT)),
                "fresh": Layer(np.uint64, (kernels.COLUMNS,)),
                "settled": Layer(np.uint64, (kernels.COLUMNS,)),
                "ticks": Layer(np.int64),
                "dues": Layer(np.int64),
            },
        )
        self.cells, self.fresh = self.layers["cells"], self.layers["fresh"]
        self.eights = self.cells.view(np.uint64)
        self.settled = self.layers["settled"]
        self.ticks, self.dues = self.layers["ticks"], self.layers["dues"]
        self.arrays = kernels.BrickArrays(
            cells=self.cells,
            eights=self.eights,
            fresh=self.fresh,
            settled=self.settled,
            observed_ns=self.observed_ns,
            ticks=self.ticks,
            dues=self.dues,
            stamps=self.stamps,
            dirty=self.dirty,
        )
        for layer in (self.cells, self.fresh, self.settled):
            layer[:READY] = 0  # written to: only then does the system commit the memory

    def obtain(self, keys: NDArray[np.int32], tick: int, stamp: int) -> NDArray[np.int64]:
        """Return slots of bricks (k, 3), made at a decay tick if they are not held: (k,).

        Where even evicting all others does not make enough room, the last ones get none: -1.
        """
        slots, new = self.reserve(keys, stamp)
        self.ticks[new] = tick
        self.dues[new] = NEVER
        return slots

    def values_at(self, cells: NDArray[np.int64]) -> tuple[NDArray[np.int8], NDArray[np.int64]]:
        """Return log-odds (n,) of cells (n, 3) as their bricks hold them, and slots (n,) of these.

        0 and -1 where no brick is held.
        """
        values, slots = np.empty(len(cells), np.int8), np.empty(len(cells), np.int64)
        kernels.look_up(self.directory, self.cells, cells, slots, values)
        return values, slots

    def rewrite_columns(
        self,
        low_cell: tuple[int, int, int],
        boxes: NDArray[np.int64],
        occupied: NDArray[np.uint64],
        free: NDArray[np.uint64],
    ) -> None:
        """Write the states of a window of cells where they lie in boxes (k, 6) of cells.

        Args:
            low_cell: Least cell of the window.
            boxes: (k, 6) cells; whole columns of bricks above and below are written.
            occupied: (nx, ny, words) bits, in and out.
            free: (nx, ny, words) bits, in and out.
        """
        (x, y, _), (nx, ny, _) = low_cell, occupied.shape
        size = [
            ((at + n - 1) >> kernels.EDGE_BITS) - (at >> kernels.EDGE_BITS) + 1
            for at, n in ((x, nx), (y, ny))
        ]
        touched, blocks = np.zeros(size, np.bool_), np.empty((math.prod(size), 2), np.int64)
        count = kernels.list_blocks(boxes, low_cell, (nx, ny), touched, blocks)
        kernels.rewrite_columns(
            self.directory, self.eights, self.settled, blocks[:count], low_cell, occupied, free
        )

    def cast_ray(
        self,
        origin: NDArray[np.float64],
        direction: NDArray[np.float64],
        reach: float,
        stop_at_unknown: bool,
    ) -> tuple[float, int]:
        """Follow a ray to the first occupied (or unknown) cell.

        Args:
            origin: (3,) in cells.
            direction: (3,) unit vector.
            reach: Maximum length, cells.
            stop_at_unknown: Whether an unknown cell stops it.

        Returns:
            Distance at which the ray enters that cell, cells, and its state; FREE if none stops it.
        """
        distance, state = kernels.cast_ray(
            self.directory, self.cells, origin, direction, reach, stop_at_unknown
        )
        return float(distance), int(state)

    def counts(self) -> dict[str, int]:
        """Return the number of free and of occupied cells by the name of their state."""
        cells = [self.cells[slot] for slot in self.live()]
        free = sum(int(np.count_nonzero(values < 0)) for values in cells)
        occupied = sum(int(np.count_nonzero(values > 0)) for values in cells)
        return {STATE_NAMES[FREE]: free, STATE_NAMES[OCCUPIED]: occupied}

    def changed_boxes(self, since: int) -> NDArray[np.int64]:
        """Return boxes of cells (k, 6) of the bricks whose states changed after a stamp."""
        keys = self.changed(since)
        return EVERYWHERE.copy() if keys is None else brick_boxes(keys)

    def digest_cells(self) -> int:
        """Return the digest of the log-odds of all bricks and of the ticks that each has seen."""

        def contents(slots: NDArray[np.int64]) -> Iterator[bytes]:
            lanes, known = np.empty((len(slots), 8), np.uint64), np.empty(len(slots), np.bool_)
            update.digest_bricks(slots, self.eights, lanes, known)
            records = np.empty(len(slots), RECORD)
            records["key"], records["ticks"] = self.keys[slots], self.ticks[slots]
            records["lanes"] = lanes
            whole, size = records.tobytes(), RECORD.itemsize
            for i, any_known in enumerate(known.tolist()):
                yield whole[i * size : (i + 1) * size] if any_known else b""

        return self.digest(contents)


BRICK_SHAPE = EDGE, EDGE, HEIGHT
"""Cells of a brick along x, y and z."""

BELOW = 0, 0, BELOW_FLOOR
"""Layers of the lowest bricks that lie below cell 0."""

BITS = EDGE_BITS, EDGE_BITS, 6
"""Bits of a cell's place in its brick, along each axis."""


def brick_of(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the indices of the bricks that cells (..., 3) lie in."""
    found: NDArray[np.int64] = (cells + np.array(BELOW)) >> np.array(BITS)
    return found


def place_in_brick(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the indices (n,) of cells (n, 3) among the cells of their bricks."""
    x, y, z = ((cells + np.array(BELOW)) & (np.array(BRICK_SHAPE) - 1)).T
    place: NDArray[np.int64] = (x * EDGE + y) * HEIGHT + z
    return place


def brick_cells(keys: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return the least cells (..., 3) of bricks (..., 3)."""
    low: NDArray[np.int64] = keys.astype(np.int64) * BRICK_SHAPE - BELOW
    return low


def brick_boxes(keys: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return the boxes of cells (k, 6) of bricks (k, 3)."""
    low = brick_cells(keys)
    return np.hstack([low, low + BRICK_SHAPE])
