"""A pool of equal slots, found by integer keys: hash directory, eviction, change log and digest."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

from wayproof.maps.kernels import slot_directory as kernels

T = TypeVar("T", bound=np.generic)

MEBIBYTE = 1 << 20

EVICTED_SHARE = 64
"""A full pool evicts one slot in this many at once, which keeps the search for them cheap."""

MAX_LOGGED = 1 << 16
"""Maximum number of keys that a change log remembers."""

EVERYWHERE = np.array([[-(1 << 40)] * 3 + [1 << 40] * 3])
"""One box of cells (1, 6) that holds all of space, where the change log is incomplete."""

DIGEST_BYTES = 16
"""Size of the digest of a slot's content."""

PARTS = DIGEST_BYTES // 4
"""Parts of 32 bits of a digest: sums of fewer than 2^32 of them fit into 64 bits."""

MODULUS = 1 << 8 * DIGEST_BYTES

NO_DIGEST = bytes(DIGEST_BYTES)
"""Digest of empty content."""


class Layer(NamedTuple):
    """An array of a pool, with one entry for each slot.

    Attributes:
        dtype: Type of its numbers.
        shape: Shape of one slot's entry.
    """

    dtype: DTypeLike
    shape: tuple[int, ...] = ()


class Reservation(NamedTuple):
    """Slots of some keys.

    Attributes:
        slots: (k,) slot of each key, -1 where there is no room.
        new: (n,) those of them that were made for it.
    """

    slots: NDArray[np.int64]
    new: NDArray[np.int64]


class ChangeLog:
    """Stamps of the last change of keys, for at most `MAX_LOGGED` keys."""

    def __init__(self) -> None:
        """Start without any change."""
        self._stamps: dict[tuple[int, ...], int] = {}
        self._complete_after = 0

    def note(self, keys: NDArray[np.integer], stamp: int) -> None:
        """Log a change of keys (k, 3) at a stamp."""
        self._stamps.update((tuple(key), stamp) for key in keys.tolist())
        if len(self._stamps) > MAX_LOGGED:
            self._stamps.clear()
            self._complete_after = stamp

    def after(self, stamp: int) -> NDArray[np.int64] | None:
        """Return keys (k, 3) that changed after a stamp; None if some are no longer known."""
        if 0 < stamp < self._complete_after:
            return None
        keys = [key for key, last in self._stamps.items() if last > stamp]
        return np.array(keys, np.int64).reshape(-1, 3)


class SlotPool:
    """Slots of equal size, each with a key (3,) of integers.

    All slots are reserved at once, and the system commits their memory as they are first used.
    When the pool is full, the part of it that was observed longest ago is evicted, of equally old
    slots those of least key: the same calls evict the same slots. A pool that grows doubles its
    capacity instead.

    Attributes:
        capacity: Number of slots.
        layers: Arrays (slots, ...) by name; 0 in slots that are not in use.
        keys: (slots, 3) int32, key of each slot.
        held: (slots,) whether each is in use.
        observed_ns: (slots,) time of the last observation, ns; -1 for none.
        stamps: (slots,) stamp of the last change of a state.
        dirty: (slots,) whether the content changed since the last digest.
    """

    def __init__(self, capacity: int, layers: Mapping[str, Layer], grows: bool = False) -> None:
        """Reserve the slots."""
        self.capacity = capacity
        self._grows = grows
        self.layers = {
            name: np.zeros((capacity, *layer.shape), layer.dtype) for name, layer in layers.items()
        }
        self.keys = np.zeros((capacity, 3), np.int32)
        self.held = np.zeros(capacity, np.bool_)
        self.observed_ns = np.zeros(capacity, np.int64)
        self.stamps = np.zeros(capacity, np.int64)
        self.dirty = np.zeros(capacity, np.bool_)
        self._heads, self._links = _empty_directory(capacity)
        self._used = 0  # slots ever used
        self._spare: list[int] = []  # those of them that are not in use
        self._released = ChangeLog()
        self._digests = np.zeros((capacity, PARTS), np.uint32)  # little-endian; 0 for none
        self._digest_sum = 0

    @property
    def directory(self) -> kernels.SlotDirectory:
        """Heads, links and keys, as the kernels find a slot by its key."""
        return kernels.SlotDirectory(self._heads, self._links, self.keys)

    @property
    def nbytes(self) -> int:
        """Bytes of the slots that are or were in use, and of the directory."""
        own = self.keys, self.held, self.observed_ns, self.stamps, self.dirty, self._links
        each = sum(array[:1].nbytes for array in (*own, *self.layers.values()))
        return self._used * each + self._heads.nbytes

    def live(self) -> NDArray[np.int64]:
        """Return slots in use, ascending."""
        return np.flatnonzero(self.held[: self._used])

    def find(self, keys: NDArray[np.integer]) -> NDArray[np.int64]:
        """Return slots of keys (k, 3), -1 where there is none: (k,)."""
        slots = np.empty(len(keys), np.int64)
        # Those of a keyframe may not be written to, for which numba would compile it once more.
        kernels.find_all(self.directory, np.require(keys, np.int32, ("C", "W")), slots)
        return slots

    def reserve(self, keys: NDArray[np.integer], stamp: int) -> Reservation:
        """Find the slots of keys (k, 3), each given once, and make those that are missing.

        Where even evicting all others does not make enough room, the last keys get no slot.
        """
        slots = self.find(keys)
        missing = np.flatnonzero(slots < 0)
        if len(missing) == 0:
            return Reservation(slots, missing)
        while self._grows and len(missing) > self._room():
            self._grow()
        if len(missing) > self._room():
            self._evict(len(missing) - self._room(), slots[slots >= 0], stamp)
        missing = missing[: self._room()]
        again = [self._spare.pop() for _ in range(min(len(self._spare), len(missing)))]
        first_uses = range(self._used, self._used + len(missing) - len(again))
        self._used += len(first_uses)
        new = np.array([*again, *first_uses], np.int64)
        slots[missing] = new
        self.keys[new] = keys[missing]
        self.held[new] = True
        self.observed_ns[new] = -1
        self.stamps[new] = 0
        kernels.insert(self.directory, new)
        return Reservation(slots, new)

    def release(self, slots: NDArray[np.int64], stamp: int) -> None:
        """Clear slots and give them up."""
        if len(slots) == 0:
            return
        kernels.remove(self.directory, slots)
        for layer in self.layers.values():
            layer[slots] = 0
        self.held[slots] = False
        self.dirty[slots] = False
        self._spare.extend(slots[::-1].tolist())
        self._digest_sum -= _total(self._digests[slots])
        self._digests[slots] = 0
        self._released.note(self.keys[slots], stamp)

    def changed(self, since: int) -> NDArray[np.int64] | None:
        """Return keys (k, 3) of the slots that changed or were released after a stamp.

        After stamp 0 those of all slots that ever changed and are in use. None if some are no
        longer known. A key may be listed twice.
        """
        used = slice(0, self._used)
        now = self.keys[used][self.held[used] & (self.stamps[used] > since)].astype(np.int64)
        if since == 0:
            return now
        released = self._released.after(since)
        return None if released is None else np.concatenate([now, released])

    def digest(self, contents: Callable[[NDArray[np.int64]], Iterable[bytes]]) -> int:
        """Sum the 128-bit digests of the slots' contents, modulo 2^128.

        Only dirty slots are hashed. The sum does not depend on the order in which slots were made,
        and a slot of empty content adds 0. Sums of independent digests collide as rarely as the
        digests (Bellare & Micciancio 1997, "A new paradigm for collision-free hashing", AdHash);
        they do not withstand someone who constructs maps that collide.

        Args:
            contents: Returns the bytes to be hashed of each of some slots (k,).
        """
        slots = np.flatnonzero(self.dirty[: self._used])
        hashed = [
            hashlib.blake2b(content, digest_size=DIGEST_BYTES).digest() if content else NO_DIGEST
            for content in contents(slots)
        ]
        digests = np.frombuffer(b"".join(hashed), "<u4").reshape(len(slots), PARTS)
        self._digest_sum += _total(digests) - _total(self._digests[slots])
        self._digests[slots] = digests
        self.dirty[slots] = False
        self._digest_sum %= MODULUS
        return self._digest_sum

    def _room(self) -> int:
        return self.capacity - self._used + len(self._spare)

    def _evict(self, needed: int, kept: NDArray[np.int64], stamp: int) -> None:
        """Release the slots observed longest ago, but none of those kept."""
        candidates = np.setdiff1d(self.live(), kept)
        x, y, z = self.keys[candidates].T
        order = np.lexsort((z, y, x, self.observed_ns[candidates]))
        count = max(needed, self.capacity // EVICTED_SHARE)
        self.release(candidates[order[:count]], stamp)

    def _grow(self) -> None:
        """Double the capacity."""
        self.layers = {name: _doubled(layer) for name, layer in self.layers.items()}
        self.keys, self.held = _doubled(self.keys), _doubled(self.held)
        self.observed_ns, self.stamps = _doubled(self.observed_ns), _doubled(self.stamps)
        self.dirty, self._digests = _doubled(self.dirty), _doubled(self._digests)
        self.capacity *= 2
        self._heads, self._links = _empty_directory(self.capacity)
        kernels.insert(self.directory, self.live())


def _total(digests: NDArray[np.uint32]) -> int:
    """Return the sum of digests (k, PARTS)."""
    sums: list[int] = digests.sum(axis=0, dtype=np.uint64).tolist()
    return sum(part << 32 * n for n, part in enumerate(sums))


def _empty_directory(capacity: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return heads of at least two buckets a slot, and links."""
    heads = np.full(1 << (2 * capacity - 1).bit_length(), -1, np.int32)
    return heads, np.zeros(capacity, np.int32)


def _doubled(array: NDArray[T]) -> NDArray[T]:
    """Return an array (n, ...) with as many zeros after it: (2 n, ...)."""
    return np.concatenate([array, np.zeros_like(array)])
