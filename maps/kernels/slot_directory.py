"""Kernels of a slot directory: a hash table with chains, from keys to slots."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel

Integer = int | np.int64


class SlotDirectory(NamedTuple):
    """Slots by key.

    Attributes:
        heads: (2^k,) first slot of each bucket, or -1.
        links: (slots,) next slot in the bucket, or -1.
        keys: (slots, 3) key of each slot.
    """

    heads: NDArray[np.int32]
    links: NDArray[np.int32]
    keys: NDArray[np.int32]


@kernel
def bucket_of(x: Integer, y: Integer, z: Integer, buckets: int) -> Integer:
    """Return the hash of Teschner et al. 2003, "Optimized spatial hashing"; `buckets` is 2^k."""
    return ((x * 73856093) ^ (y * 19349663) ^ (z * 83492791)) & (buckets - 1)


@kernel
def find(
    heads: NDArray[np.int32],  # (2^k,) first slot of each bucket, or -1
    links: NDArray[np.int32],  # (slots,) next one in the bucket, or -1
    keys: NDArray[np.int32],  # (slots, 3)
    x: Integer,
    y: Integer,
    z: Integer,
) -> int:
    """Find the slot of a key, or -1."""
    slot = int(heads[bucket_of(x, y, z, heads.shape[0])])
    while slot >= 0 and not (keys[slot, 0] == x and keys[slot, 1] == y and keys[slot, 2] == z):
        slot = int(links[slot])
    return slot


@kernel
def find_all(
    directory: SlotDirectory,
    queries: NDArray[np.int32],  # (k, 3) keys
    slots: NDArray[np.int64],  # (k,) out: -1 where there is none
) -> None:
    """Find the slots of keys."""
    heads, links, keys = directory
    for i in range(queries.shape[0]):
        # In numba an int of 32 bits stays one, and all that takes it is compiled once more.
        x, y, z = np.int64(queries[i, 0]), np.int64(queries[i, 1]), np.int64(queries[i, 2])
        slots[i] = find(heads, links, keys, x, y, z)


@kernel
def insert(
    directory: SlotDirectory,  # in, out
    slots: NDArray[np.int64],  # (k,) keys already written
) -> None:
    """Insert slots."""
    heads, links, keys = directory
    for i in range(slots.shape[0]):
        slot = slots[i]
        x, y, z = np.int64(keys[slot, 0]), np.int64(keys[slot, 1]), np.int64(keys[slot, 2])
        bucket = bucket_of(x, y, z, heads.shape[0])
        links[slot] = heads[bucket]
        heads[bucket] = slot


@kernel
def remove(
    directory: SlotDirectory,  # in, out
    slots: NDArray[np.int64],  # (k,)
) -> None:
    """Remove slots."""
    heads, links, keys = directory
    for i in range(slots.shape[0]):
        slot = slots[i]
        x, y, z = np.int64(keys[slot, 0]), np.int64(keys[slot, 1]), np.int64(keys[slot, 2])
        bucket = bucket_of(x, y, z, heads.shape[0])
        at = np.int64(heads[bucket])
        if at == slot:
            heads[bucket] = links[slot]
            continue
        while links[at] != slot:
            at = np.int64(links[at])
        links[at] = links[slot]
