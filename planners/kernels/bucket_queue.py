"""A priority queue of cells by integer keys: a ring of buckets, each a doubly linked list.

Dial, "Algorithm 360: Shortest-path forest with topological ordering", CACM 1969. Arrays, and no
tuple of them, are passed: in a loop each array taken out of a tuple has its references counted.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel

Integers = NDArray[np.int32]


@kernel
def bucket_of(head: Integers, key: int) -> np.uint64:
    """Return the bucket of a key; keys that differ by whole rounds of the ring share it."""
    return np.uint64(key) & np.uint64(len(head) - 1)


@kernel
def insert(
    head: Integers,  # (b,) first cell of each bucket, -1 if none; b is a power of two
    after: Integers,  # (n,) next cell in the same bucket
    before: Integers,  # (n,) previous cell in the same bucket
    keys: Integers,  # (n,)
    cell: int,
    key: int,
) -> None:
    """Put a cell first into the bucket of its key."""
    at, bucket = np.uint64(cell), bucket_of(head, key)
    first = head[bucket]
    keys[at] = key
    after[at] = first
    before[at] = -1
    if first >= 0:
        before[np.uint64(first)] = cell
    head[bucket] = cell


@kernel
def remove(head: Integers, after: Integers, before: Integers, keys: Integers, cell: int) -> None:
    """Take a cell out of its bucket."""
    at = np.uint64(cell)
    if before[at] >= 0:
        after[np.uint64(before[at])] = after[at]
    else:
        head[bucket_of(head, keys[at])] = after[at]
    if after[at] >= 0:
        before[np.uint64(after[at])] = before[at]
