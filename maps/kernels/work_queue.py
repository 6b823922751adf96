"""Queue of work items that threads share while they are in compiled kernels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.maps._jit import kernel
from wayproof.maps.kernels.intrinsics import fetch_add

CHUNK_SHARES = 4  # each thread takes such a part of its share of what is left

Queue = NDArray[np.int64]
"""(1,) index of the next item; at the number of items or beyond, none is left."""


def new_queue() -> Queue:
    """Return a queue from which no item has been taken."""
    return np.zeros(1, np.int64)


@kernel
def take_item(queue: Queue) -> int:
    """Take one item; return its index."""
    return int(fetch_add(queue, 1))


@kernel
def take_chunk(queue: Queue, count: int, threads: int) -> tuple[int, int]:
    """Take successive items of `count`: many at first and ever fewer, so that threads end together.

    Guided self-scheduling (Polychronopoulos & Kuck 1987). Neighbours are taken together, as they
    share cache lines.

    Returns:
        The first, and one past the last; equal where none is left.
    """
    size = max(1, (count - queue[0]) // (CHUNK_SHARES * threads))
    first = fetch_add(queue, size)
    return min(first, count), min(first + size, count)
