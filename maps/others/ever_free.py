"""Space that is known with confidence to be free: what appears in it has moved there."""

from __future__ import annotations

import hashlib
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.kernels import bricks
from wayproof.maps.kernels import tracking as kernels
from wayproof.maps.voxel.update_mask import brick_of

Key = tuple[int, int, int]
ReadFree = Callable[[NDArray[np.int64]], NDArray[np.uint64]]
"""The free cells (k, 256) of bricks (k, 3), a bit each."""

FIRST_SLOTS = 64
MODULUS = 1 << 128
NEAR = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), axis=-1).reshape(27, 3)


class EverFreeSpace:
    """The cells that were free for a whole period, and with them all of their 26 neighbours.

    This is the "ever-free" space of Schmid et al. 2023, "Dynablox: Real-time Detection of Diverse
    Dynamic Objects in Complex Environments" (RA-L 8), on the states of a voxel map. Asking for the
    neighbours keeps the noise of a surface, and an error of the pose of less than a cell, from
    looking like motion.

    Periods follow one another from time 0, so a cell becomes confident after one to two of them.
    Two bits a cell are kept: whether it is confident, and whether it has been free, and not hit,
    since the period began. Only bricks that changed are looked at.
    """

    def __init__(self) -> None:
        """Start without confidence in anything."""
        self._slots: dict[Key, int] = {}
        self._spare: list[int] = []
        self._keys = np.zeros((FIRST_SLOTS, 3), np.int64)
        self._held = np.zeros(FIRST_SLOTS, np.bool_)
        self._confident = np.zeros((FIRST_SLOTS, bricks.COLUMNS), np.uint64)
        self._steady = np.zeros((FIRST_SLOTS, bricks.COLUMNS), np.uint64)  # since the period began
        self._restless: set[Key] = set()  # bricks that changed in this period
        self._settling: set[Key] = set()  # and in the one before
        self._order: NDArray[np.int64] | None = None  # slots in lexical order of their bricks
        self._dirty: set[int] = set()
        self._digests: dict[int, int] = {}
        self._sum = 0

    @property
    def nbytes(self) -> int:
        """Bytes that are held."""
        return self._confident.nbytes + self._steady.nbytes

    def holds(self, cells: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whether cells (n, 3) are confidently free: (n,)."""
        slots, columns, bits = self._addresses(cells)
        held: NDArray[np.bool_] = (slots >= 0) & (self._confident[slots, columns] & bits != 0)
        return held

    def narrow(
        self, keys: NDArray[np.int64], free: NDArray[np.uint64], kept: NDArray[np.int64]
    ) -> None:
        """Lose what is free no more.

        Args:
            keys: (k, 3) bricks that changed.
            free: (k, 256) their free cells, a bit each.
            kept: (m, 3) confident cells that stay so although something is in them.
        """
        names = _names(keys)
        self._restless.update(names)
        slots = np.array([self._slot(name) for name in names], np.int64)
        held = self.holds(kept)
        self._steady[slots] &= free
        self._confident[slots] &= free
        self._set(kept[held])
        self._dirty.update(slots.tolist())

    def strike(self, cells: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Tell which of the cells (n, 3) that were hit are confident, (n,); none is steady now."""
        slots, columns, bits = self._addresses(cells)
        inside = slots >= 0
        shaken = inside & (self._steady[slots, columns] & bits != 0)
        np.bitwise_and.at(self._steady, (slots[shaken], columns[shaken]), ~bits[shaken])
        touched = np.unique(slots[shaken])
        self._restless.update(_names(self._keys[touched]))
        self._dirty.update(touched.tolist())
        met: NDArray[np.bool_] = inside & (self._confident[slots, columns] & bits != 0)
        return met

    def forget(self, cells: NDArray[np.int64], kept: NDArray[np.int64]) -> None:
        """Lose the confidence in cells (n, 3) and their neighbours, but not in those kept (m, 3).

        What stays in a place is a surface from then on, with noise around it.
        """
        lost = (cells[:, None] + NEAR).reshape(-1, 3)
        held = self.holds(kept)
        slots, columns, bits = self._addresses(lost)
        known = slots >= 0
        np.bitwise_and.at(self._confident, (slots[known], columns[known]), ~bits[known])
        self._set(kept[held])
        self._dirty.update(np.unique(slots[known]).tolist())

    def close_period(self, read_free: ReadFree) -> None:
        """Trust what was steady for this period, and begin the next one."""
        active = self._restless | self._settling
        near = {
            (x + dx, y + dy, z + dz) for x, y, z in active for dx, dy, dz in NEAR.tolist()
        } & self._slots.keys()
        names = sorted(near)
        around = np.array(
            [
                [self._slots.get((x + dx, y + dy, z + dz), -1) for dx, dy, dz in NEAR.tolist()]
                for x, y, z in names
            ],
            np.int64,
        ).reshape(-1, 3, 3, 3)
        shrunk = np.empty((len(names), bricks.COLUMNS), np.uint64)
        kernels.shrink(self._steady, around, shrunk)
        slots = around[:, 1, 1, 1]
        self._confident[slots] |= shrunk
        self._dirty.update(slots.tolist())
        changed = sorted(self._restless)
        free = read_free(np.array(changed, np.int64).reshape(-1, 3))
        self._steady[[self._slot(name) for name in changed]] = free
        self._release(changed)
        self._settling, self._restless = self._restless & self._slots.keys(), set()

    def digest(self) -> int:
        """Sum of the bricks' 128-bit digests modulo 2^128, in which their order does not count."""
        for slot in sorted(self._dirty):
            new = 0
            if self._held[slot] and (self._confident[slot].any() or self._steady[slot].any()):
                content = [a[slot].astype("<u8") for a in (self._confident, self._steady)]
                seal = hashlib.blake2b(self._keys[slot].astype("<i8").tobytes(), digest_size=16)
                seal.update(b"".join(part.tobytes() for part in content))
                new = int.from_bytes(seal.digest(), "little")
            self._sum = (self._sum + new - self._digests.get(slot, 0)) % MODULUS
            self._digests[slot] = new
        self._dirty.clear()
        return self._sum

    def keys(self) -> NDArray[np.int64]:
        """The bricks (k, 3) that anything is kept of."""
        return self._keys[self._held]

    def _slot(self, name: Key) -> int:
        """The slot of a brick, made if there is none."""
        slot = self._slots.get(name)
        if slot is None:
            slot = self._spare.pop() if self._spare else len(self._slots)
            if slot == len(self._held):
                self._grow()
            self._slots[name], self._order = slot, None
            self._keys[slot], self._held[slot] = name, True
        return slot

    def _grow(self) -> None:
        self._keys = np.concatenate([self._keys, np.zeros_like(self._keys)])
        self._held = np.concatenate([self._held, np.zeros_like(self._held)])
        self._confident = np.concatenate([self._confident, np.zeros_like(self._confident)])
        self._steady = np.concatenate([self._steady, np.zeros_like(self._steady)])

    def _release(self, names: list[Key]) -> None:
        """Give up those of the bricks that nothing is kept of: the map's own bound holds here."""
        for name in names:
            slot = self._slots[name]
            if not (self._steady[slot].any() or self._confident[slot].any()):
                del self._slots[name]
                self._held[slot], self._order = False, None
                self._spare.append(slot)
                self._dirty.add(slot)

    def _set(self, cells: NDArray[np.int64]) -> None:
        slots, columns, bits = self._addresses(cells)
        np.bitwise_or.at(self._confident, (slots, columns), bits)

    def _addresses(
        self, cells: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.uint64]]:
        """Slot (-1: none), column and bit of cells (n, 3), each (n,)."""
        columns = ((cells[:, 0] & (bricks.EDGE - 1)) << bricks.EDGE_BITS) + (
            cells[:, 1] & (bricks.EDGE - 1)
        )
        bits = np.uint64(1) << ((cells[:, 2] + bricks.BELOW_FLOOR) & 63).astype(np.uint64)
        if self._order is None:
            held = np.flatnonzero(self._held)
            self._order = held[np.lexsort(self._keys[held].T[::-1])]
        places = np.empty(len(cells), np.int64)
        kernels.locate_all(self._keys[self._order], brick_of(cells), places)
        slots = np.append(self._order, -1)[places]  # the place -1 is the last
        return slots, columns, bits


def _names(keys: NDArray[np.int64]) -> list[Key]:
    return [(x, y, z) for x, y, z in keys.tolist()]
