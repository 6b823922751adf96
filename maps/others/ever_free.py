"""Ever-free space: cells known with confidence to be free, where an object that appears moved.

Schmid et al. 2023, "Dynablox: Real-time Detection of Diverse Dynamic Objects in Complex
Environments" (RA-L 8).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.cell_sets import as_set
from wayproof.maps.kernels import bricks
from wayproof.maps.kernels import tracking as kernels
from wayproof.maps.slot_pool import Layer, SlotPool
from wayproof.maps.voxel.bricks import brick_of

ReadFree = Callable[[NDArray[np.int64]], NDArray[np.uint64]]
"""The free cells (k, 256) of bricks (k, 3), a bit each."""

FIRST_SLOTS = 64
NEIGHBOURS = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), axis=-1).reshape(27, 3)


class EverFreeSpace:
    """The cells that were free for a whole period, and with them all of their 26 neighbours.

    The neighbours count so that neither the noise of a surface nor an error of the pose of less
    than a cell looks like motion.

    Periods follow one another from time 0, so a cell becomes ever-free after one to two of them.
    Two bits a cell are kept: whether it is ever-free, and whether it has been free, and not hit,
    since the period began. Only bricks that changed are looked at.
    """

    def __init__(self) -> None:
        """Start without any ever-free cell."""
        plane = Layer(np.uint64, (bricks.COLUMNS,))
        flag = Layer(np.bool_)
        layers = {"ever_free": plane, "free": plane, "changed": flag, "changed_before": flag}
        # Bounded by the map, whose bricks it follows.
        self._pool = SlotPool(FIRST_SLOTS, layers, grows=True)

    @property
    def nbytes(self) -> int:
        """Bytes of the bricks."""
        return self._pool.nbytes

    def contains(self, cells: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return whether cells (n, 3) are ever-free: (n,)."""
        slots, columns, bits = self._addresses(cells)
        ever_free: NDArray[np.bool_] = self._pool.layers["ever_free"][slots, columns] & bits != 0
        return ever_free & (slots >= 0)

    def keep_free(
        self, keys: NDArray[np.int64], free: NDArray[np.uint64], kept: NDArray[np.int64]
    ) -> None:
        """Remove cells that are no longer free.

        Args:
            keys: (k, 3) bricks that changed.
            free: (k, 256) their free cells, a bit each.
            kept: (m, 3) ever-free cells that remain so although something is in them.
        """
        remain = kept[self.contains(kept)]
        slots = self._obtain(keys)
        self._pool.layers["free"][slots] &= free
        self._pool.layers["ever_free"][slots] &= free
        self._note_changed(slots)
        self._set(remain)

    def record_hits(self, cells: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Record hits in cells (n, 3), and return which of them are ever-free: (n,)."""
        slots, columns, bits = self._addresses(cells)
        known = slots >= 0
        free = self._pool.layers["free"]
        hit = known & (free[slots, columns] & bits != 0)
        np.bitwise_and.at(free, (slots[hit], columns[hit]), ~bits[hit])
        self._note_changed(slots[hit])
        ever_free: NDArray[np.bool_] = self._pool.layers["ever_free"][slots, columns] & bits != 0
        return ever_free & known

    def remove(self, cells: NDArray[np.int64], kept: NDArray[np.int64]) -> None:
        """Remove cells (n, 3) and their neighbours, but none of those kept (m, 3).

        What stays in a place is a surface from then on, with noise around it.
        """
        remain = kept[self.contains(kept)]
        slots, columns, bits = self._addresses((cells[:, None] + NEIGHBOURS).reshape(-1, 3))
        known = slots >= 0
        at = slots[known], columns[known]
        np.bitwise_and.at(self._pool.layers["ever_free"], at, ~bits[known])
        self._pool.dirty[slots[known]] = True
        self._set(remain)

    def close_period(self, read_free: ReadFree) -> None:
        """Take cells that were free for this period for ever-free, and begin the next period."""
        pool = self._pool
        active = pool.keys[pool.layers["changed"] | pool.layers["changed_before"]]
        near = as_set((active[:, None] + NEIGHBOURS).reshape(-1, 3).astype(np.int64))
        near = near[pool.find(near) >= 0]
        around = pool.find((near[:, None] + NEIGHBOURS).reshape(-1, 3)).reshape(-1, 3, 3, 3)
        shrunk = np.empty((len(near), bricks.COLUMNS), np.uint64)
        kernels.erode(pool.layers["free"], around, shrunk)
        slots = around[:, 1, 1, 1]
        pool.layers["ever_free"][slots] |= shrunk
        pool.dirty[slots] = True
        changed = np.flatnonzero(pool.layers["changed"])
        pool.layers["free"][changed] = read_free(pool.keys[changed].astype(np.int64))
        pool.dirty[changed] = True
        pool.layers["changed_before"][:] = pool.layers["changed"]
        pool.layers["changed"][:] = False
        empty = ~(pool.layers["free"][changed] | pool.layers["ever_free"][changed]).any(axis=1)
        pool.release(changed[empty], stamp=0)

    def digest(self) -> int:
        """Sum of the bricks' 128-bit digests modulo 2^128, in which their order does not count."""

        def contents(slots: NDArray[np.int64]) -> Iterator[bytes]:
            for slot in slots.tolist():
                planes = [self._pool.layers[name][slot] for name in ("ever_free", "free")]
                key = self._pool.keys[slot].astype("<i8")
                content = b"".join(part.astype("<u8").tobytes() for part in (key, *planes))
                yield content if any(plane.any() for plane in planes) else b""

        return self._pool.digest(contents)

    def keys(self) -> NDArray[np.int64]:
        """Return the bricks (k, 3) with any content."""
        return self._pool.keys[self._pool.live()].astype(np.int64)

    def _obtain(self, keys: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return slots (k,) of bricks (k, 3), made if missing; a brick may be given twice."""
        slots = self._pool.find(keys)
        if (slots < 0).any():
            self._pool.reserve(as_set(keys[slots < 0]), stamp=0)
            slots = self._pool.find(keys)
        return slots

    def _note_changed(self, slots: NDArray[np.int64]) -> None:
        self._pool.layers["changed"][slots] = True
        self._pool.dirty[slots] = True

    def _set(self, cells: NDArray[np.int64]) -> None:
        """Make cells (n, 3) of known bricks ever-free."""
        slots, columns, bits = self._addresses(cells)
        np.bitwise_or.at(self._pool.layers["ever_free"], (slots, columns), bits)
        self._pool.dirty[slots] = True

    def _addresses(
        self, cells: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.uint64]]:
        """Return the slot (-1: none), column and bit of cells (n, 3), each (n,)."""
        edge = bricks.EDGE - 1
        columns = ((cells[:, 0] & edge) << bricks.EDGE_BITS) + (cells[:, 1] & edge)
        bits = np.uint64(1) << ((cells[:, 2] + bricks.BELOW_FLOOR) & 63).astype(np.uint64)
        return self._pool.find(brick_of(cells)), columns, bits
