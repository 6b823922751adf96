"""The bricks that a map holds: a pool of fixed size with a directory."""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.kernels import bricks as kernels
from wayproof.maps.kernels import update
from wayproof.maps.kernels.decay import NEVER
from wayproof.maps.parallel import ThreadTeam
from wayproof.maps.voxel.update_mask import brick_cells

CELLS_IN_BRICK = kernels.COLUMNS * kernels.HEIGHT
BYTES_IN_BRICK = CELLS_IN_BRICK * 5 // 4 + 80
MEBIBYTE = 1 << 20

DROPPED_AT_ONCE = 64
"""A full pool drops this part of its bricks, so that looking for them costs little a sweep."""

READY = 1024
"""Bricks whose memory is taken before the first sweep: 100,000 rays at 5 cm meet some 850 at once.
To be given it page by page took 8 of the 14 to 17 ms of a first sweep, on two threads."""

MAX_GONE = 1 << 16
DIGEST_US = 2.0  # about, a brick
EVERYWHERE = np.array([[-(1 << 40)] * 3 + [1 << 40] * 3])
MODULUS = 1 << 128
RECORD = np.dtype([("key", "<i4", 3), ("ticks", "<i8"), ("lanes", "<u8", 8)])  # without gaps
"""What the digest of a brick is made of."""


class Bricks:
    """A pool of bricks, found by their index.

    The pool is reserved at once, but beyond the first `READY` bricks the system gives memory only
    as they are first used. When it is full, the sixty-fourth part of it that was observed longest
    ago is dropped, of equally old bricks those of least index: the same sweeps drop the same ones.

    Attributes:
        capacity: Bricks that fit the memory.
        keys: (slots, 3) int32, index of each brick.
        cells: (slots, 256, 64) int8, log-odds in units.
        eights: (slots, 256, 8) uint64, the same memory.
        fresh: (slots, 256) uint64, cells that were updated since the last tick.
        settled: (slots, 256) uint64, cells known to lie at the lower clamp.
        observed_ns: (slots,) last observation.
        ticks: (slots,) decay ticks that the cells have seen.
        dues: (slots,) tick at which a brick has to be looked at.
    """

    def __init__(self, memory_mib: int) -> None:
        """Reserve a pool that takes at most `memory_mib`."""
        self.capacity = max(memory_mib * MEBIBYTE // BYTES_IN_BRICK, 1)
        slots = self.capacity
        self.keys = np.zeros((slots, 3), np.int32)
        self.cells = np.zeros((slots, kernels.COLUMNS, kernels.HEIGHT), np.int8)
        self.eights = self.cells.view(np.uint64)
        self.fresh = np.zeros((slots, kernels.COLUMNS), np.uint64)
        self.settled = np.zeros((slots, kernels.COLUMNS), np.uint64)
        self.observed_ns = np.zeros(slots, np.int64)
        self.ticks = np.zeros(slots, np.int64)
        self.dues = np.zeros(slots, np.int64)
        self.held = np.zeros(slots, np.bool_)
        self.dirty = np.zeros(slots, np.bool_)  # its digest is not that of its content
        self.stamps = np.zeros(slots, np.int64)  # of the last change of a state
        for layer in (self.cells, self.fresh, self.settled):
            layer[:READY] = 0  # written to: only then does the system give the memory
        self._heads = np.full(1 << (2 * slots - 1).bit_length(), -1, np.int32)
        self._links = np.zeros(slots, np.int32)
        self._used = 0  # slots ever used
        self._spare: list[int] = []  # those of them that are free again
        self._digests: dict[int, int] = {}
        self._sum = 0
        self._gone: dict[tuple[int, ...], int] = {}
        self._forgotten = 0  # of the bricks gone up to this stamp not all are remembered

    @property
    def directory(self) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
        """What the kernels find a brick with."""
        return self._heads, self._links, self.keys

    @property
    def nbytes(self) -> int:
        """Bytes of the bricks that are or were in use."""
        return self._used * BYTES_IN_BRICK + self._heads.nbytes

    def live(self) -> NDArray[np.int64]:
        """Slots in use."""
        return np.flatnonzero(self.held[: self._used])

    def find(self, keys: NDArray[np.int32]) -> NDArray[np.int64]:
        """Slots of bricks (k, 3), -1 where there is none: (k,)."""
        slots = np.empty(len(keys), np.int64)
        kernels.find_all(*self.directory, keys, slots)
        return slots

    def reserve(self, keys: NDArray[np.int32], tick: int, stamp: int) -> NDArray[np.int64]:
        """Slots of bricks (k, 3), which are made if they are not held: (k,).

        Where even dropping all others does not make enough room, the last ones get none: -1.
        """
        slots = self.find(keys)
        missing = np.flatnonzero(slots < 0)
        if len(missing) == 0:
            return slots
        room = self.capacity - self._used + len(self._spare)
        if len(missing) > room:
            self._drop_oldest(len(missing) - room, slots[slots >= 0], stamp)
            room = self.capacity - self._used + len(self._spare)
        missing = missing[:room]
        again = [self._spare.pop() for _ in range(min(len(self._spare), len(missing)))]
        fresh = range(self._used, self._used + len(missing) - len(again))
        self._used += len(fresh)
        made = np.array([*again, *fresh], np.int64)
        slots[missing] = made
        self.keys[made] = keys[missing]
        self.held[made] = True
        self.observed_ns[made] = -1
        self.ticks[made] = tick
        self.dues[made] = NEVER
        self.stamps[made] = 0
        kernels.enter(*self.directory, made)
        return slots

    def release(self, slots: NDArray[np.int64], stamp: int) -> None:
        """Give bricks up; all of their cells are unknown from now on."""
        if len(slots) == 0:
            return
        kernels.strike_out(*self.directory, slots)
        self.cells[slots] = 0
        self.fresh[slots] = 0
        self.settled[slots] = 0
        self.held[slots] = False
        self.dirty[slots] = False
        self._spare.extend(slots[::-1].tolist())
        for slot, key in zip(slots.tolist(), self.keys[slots].tolist(), strict=True):
            self._sum -= self._digests.pop(slot, 0)
            self._gone[tuple(key)] = stamp
        if len(self._gone) > MAX_GONE:
            self._gone.clear()
            self._forgotten = stamp

    def changed(self, since: int) -> NDArray[np.int64]:
        """Boxes of cells (k, 6) of the bricks whose states changed after a stamp."""
        if 0 < since < self._forgotten:
            return EVERYWHERE.copy()
        boxes = np.empty((self._used, 6), np.int64)
        count = kernels.list_changed(self.held, self.stamps, self.keys, since, boxes)
        gone = [key for key, stamp in self._gone.items() if since and stamp > since]
        if not gone:
            return boxes[:count]
        keys = np.array(gone, np.int32)
        of_gone = np.hstack([brick_cells(keys), brick_cells(keys + np.int32(1))])
        return np.concatenate([boxes[:count], of_gone])

    def digest(self, team: ThreadTeam) -> int:
        """Sum over the bricks of their 128-bit digests, modulo 2^128; only dirty ones are hashed.

        A sum does not depend on the order in which bricks were made, and a brick of nothing but
        unknown cells adds 0. Sums of independent digests collide as rarely as the digests (Bellare
        & Micciancio 1997, "A new paradigm for collision-free hashing", AdHash); they do not
        withstand someone who makes maps up to collide, which is not what a version is for.
        """
        slots = np.flatnonzero(self.dirty[: self._used])
        lanes, held = np.empty((len(slots), 8), np.uint64), np.empty(len(slots), np.bool_)

        def digest(_: int, part: tuple[int, int]) -> None:
            update.digest_bricks(slots, part, self.eights, lanes, held)

        team.parallel_for(digest, len(slots), 1, DIGEST_US)
        records = np.empty(len(slots), RECORD)
        records["key"], records["ticks"] = self.keys[slots], self.ticks[slots]
        records["lanes"] = lanes
        contents, size = records.tobytes(), RECORD.itemsize
        for i, (slot, known) in enumerate(zip(slots.tolist(), held.tolist(), strict=True)):
            new = 0
            if known:
                seal = hashlib.blake2b(contents[i * size : (i + 1) * size], digest_size=16)
                new = int.from_bytes(seal.digest(), "little")
            self._sum += new - self._digests.get(slot, 0)
            self._digests[slot] = new
        self.dirty[slots] = False
        self._sum %= MODULUS
        return self._sum

    def _drop_oldest(self, needed: int, kept: NDArray[np.int64], stamp: int) -> None:
        candidates = np.setdiff1d(self.live(), kept)
        x, y, z = self.keys[candidates].T
        order = np.lexsort((z, y, x, self.observed_ns[candidates]))
        count = max(needed, self.capacity // DROPPED_AT_ONCE)
        self.release(candidates[order[:count]], stamp)
