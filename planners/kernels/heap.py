"""A binary heap of integer keys in an array that grows.

Written out, as Python's `heapq` on a list takes twice the time in a kernel.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import allocating, kernel

ONE = np.uint64(1)

Longs = NDArray[np.int64]


@allocating
def push(heap: Longs, count: int, key: int) -> Longs:
    """Push a key into a heap of `count` keys; return the heap, a longer one if it was full."""
    if count == len(heap):
        heap = np.concatenate((heap, np.empty(count, np.int64)))
    at = np.uint64(count)  # unsigned indices skip the check for negatives
    while at > 0:
        above = (at - ONE) >> ONE
        if heap[above] <= key:
            break
        heap[at] = heap[above]
        at = above
    heap[at] = key
    return heap


@kernel
def pop(heap: Longs, count: int) -> int:
    """Pop the least key from a heap, which then has `count` keys."""
    least, end = heap[0], np.uint64(count)
    last, at, below = heap[end], np.uint64(0), ONE
    while below + ONE < end:
        # Without a branch: which of the two is less cannot be predicted.
        below += np.uint64(heap[below + ONE] < heap[below])
        if heap[below] >= last:
            break
        heap[at] = heap[below]
        at, below = below, (below << ONE) + ONE
    if below + ONE == end and heap[below] < last:  # the last pair has one key only
        heap[at] = heap[below]
        at = below
    heap[at] = last
    return int(least)
