"""Blocks of cells, found by their index: where a representation without bounds keeps its cells."""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Mapping

import numpy as np
from numpy.typing import DTypeLike, NDArray

from wayproof.maps.kernels import update as kernels
from wayproof.maps.parallel import ThreadTeam

MEBIBYTE = 1 << 20
HEAD_BYTES = 128  # of a block, besides its cells

DROPPED_AT_ONCE = 64
"""A full pool drops this part of its blocks, so that looking for them costs little a sweep."""

MAX_GONE = 1 << 16
EVERYWHERE = np.array([[-(1 << 40)] * 3 + [1 << 40] * 3])
MODULUS = 1 << 128


class Blocks:
    """A pool of blocks of one shape; each cell has one value in every layer.

    The system gives memory only as blocks are first used. When the pool is full, the sixty-fourth
    part of it that was observed longest ago is dropped, of equally old blocks those of least index:
    the same sweeps drop the same blocks.

    Attributes:
        shape: Cells of a block along x, y and z.
        capacity: Blocks that fit the memory.
        layers: By name an array (slots, cells) of what is held of each cell; 0 where unknown.
        keys: (slots, 3) index of each block.
        observed_ns: (slots,) last observation.
        stamps: (slots,) of the last change of a state.
        dirty: (slots,) whether the content changed since the last digest.
    """

    def __init__(
        self, memory_mib: int, shape: tuple[int, int, int], layers: Mapping[str, DTypeLike]
    ) -> None:
        """Reserve a pool that takes at most `memory_mib`."""
        self.shape = shape
        cells = int(np.prod(shape))
        each = cells * sum(np.dtype(kind).itemsize for kind in layers.values())
        self._bytes_each = each + HEAD_BYTES
        self.capacity = slots = max(memory_mib * MEBIBYTE // self._bytes_each, 1)
        self.layers = {name: np.zeros((slots, cells), kind) for name, kind in layers.items()}
        self.keys = np.zeros((slots, 3), np.int64)
        self.observed_ns = np.zeros(slots, np.int64)
        self.stamps = np.zeros(slots, np.int64)
        self.dirty = np.zeros(slots, np.bool_)
        self._slots: dict[tuple[int, ...], int] = {}
        self._used = 0  # slots ever used
        self._spare: list[int] = []  # those of them that are free again
        self._digests: dict[int, int] = {}
        self._sum = 0
        self._gone: dict[tuple[int, ...], int] = {}
        self._forgotten = 0  # of the blocks gone up to this stamp not all are remembered

    @property
    def nbytes(self) -> int:
        """Bytes of the blocks that are or were in use."""
        return self._used * self._bytes_each

    def live(self) -> NDArray[np.int64]:
        """Slots in use, ascending."""
        return np.array(sorted(self._slots.values()), np.int64)

    def find(self, keys: NDArray[np.int64]) -> NDArray[np.int64]:
        """Slots of blocks (k, 3), -1 where there is none: (k,)."""
        return np.array([self._slots.get(tuple(key), -1) for key in keys.tolist()], np.int64)

    def locate(self, cells: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Slots of the blocks of cells (n, 3), -1 where none is held, and their places in these."""
        if len(cells) == 0:
            return np.empty(0, np.int64), np.empty(0, np.int64)
        keys = cells // self.shape
        inside = keys - keys.min(axis=0)
        names = np.zeros(len(keys), np.int64)
        for axis in range(3):  # numbered anew after each, so that none overflows
            wide = names * (inside[:, axis].max() + 1) + inside[:, axis]
            _, first, names = np.unique(wide, return_index=True, return_inverse=True)
        x, y, z = (cells % self.shape).T
        _, ny, nz = self.shape
        return self.find(keys[first])[names], (x * ny + y) * nz + z

    def reserve(self, keys: NDArray[np.int64], stamp: int) -> NDArray[np.int64]:
        """Slots of blocks (k, 3), which are made if they are not held: (k,).

        Where even dropping all others does not make enough room, the last ones get none: -1.
        """
        slots = self.find(keys)
        missing = np.flatnonzero(slots < 0)
        if len(missing) > self._room():
            self._drop_oldest(len(missing) - self._room(), slots[slots >= 0], stamp)
        for i in missing[: self._room()].tolist():
            slots[i] = self._make(tuple(keys[i].tolist()))
        return slots

    def release(self, slots: NDArray[np.int64], stamp: int) -> None:
        """Give blocks up; all of their cells are unknown from now on."""
        for slot in slots.tolist():
            key = tuple(self.keys[slot].tolist())
            del self._slots[key]
            for layer in self.layers.values():
                layer[slot] = 0
            self.dirty[slot] = False
            self._sum -= self._digests.pop(slot, 0)
            self._gone[key] = stamp
            self._spare.append(slot)
        if len(self._gone) > MAX_GONE:
            self._gone.clear()
            self._forgotten = stamp

    def changed(self, since: int) -> NDArray[np.int64]:
        """Boxes of cells (k, 6) of the blocks whose states changed after a stamp."""
        if 0 < since < self._forgotten:
            return EVERYWHERE.copy()
        live = self.live()
        now = self.keys[live[self.stamps[live] > since]]
        gone = [key for key, stamp in self._gone.items() if since and stamp > since]
        keys = np.concatenate([now, np.array(gone, np.int64).reshape(-1, 3)])
        return np.hstack([keys * self.shape, (keys + 1) * self.shape])

    def digest(self, told: tuple[str, ...], team: ThreadTeam) -> int:
        """Sum over the blocks of the 128-bit digests of some of their layers, modulo 2^128.

        Only dirty blocks are hashed, as `Bricks.digest` hashes bricks; one of nothing but unknown
        cells adds 0. A sum does not depend on the order in which blocks were made.
        """
        slots = np.flatnonzero(self.dirty[: self._used])
        lanes = np.empty((len(told), len(slots), 8), np.uint64)
        held = np.empty((len(told), len(slots)), np.bool_)
        words = [self.layers[n].view(np.uint64).reshape(len(self.keys), -1, 8) for n in told]

        def digest(_: int, part: tuple[int, int]) -> None:
            for layer, sums, any_held in zip(words, lanes, held, strict=True):
                kernels.digest_bricks(slots, part, layer, sums, any_held)

        team.parallel_for(digest, len(slots), parts_per_thread=1)
        for i, slot in enumerate(slots.tolist()):
            new = 0
            if held[:, i].any():
                head = struct.pack("<3q", *self.keys[slot].tolist())
                contents = lanes[:, i].astype("<u8").tobytes()
                seal = hashlib.blake2b(head + contents, digest_size=16)
                new = int.from_bytes(seal.digest(), "little")
            self._sum += new - self._digests.get(slot, 0)
            self._digests[slot] = new
        self.dirty[slots] = False
        self._sum %= MODULUS
        return self._sum

    def _room(self) -> int:
        return self.capacity - len(self._slots)

    def _make(self, key: tuple[int, ...]) -> int:
        if self._spare:
            slot = self._spare.pop()
        else:
            slot, self._used = self._used, self._used + 1
        self._slots[key] = slot
        self.keys[slot] = key
        self.observed_ns[slot] = -1
        self.stamps[slot] = 0
        return slot

    def _drop_oldest(self, needed: int, kept: NDArray[np.int64], stamp: int) -> None:
        candidates = np.setdiff1d(self.live(), kept)
        x, y, z = self.keys[candidates].T
        order = np.lexsort((z, y, x, self.observed_ns[candidates]))
        count = max(needed, self.capacity // DROPPED_AT_ONCE)
        self.release(candidates[order[:count]], stamp)
