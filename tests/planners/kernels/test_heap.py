import heapq

import numpy as np
import pytest

from wayproof.planners.kernels import (
    heap,
)


@pytest.mark.parametrize("python", [False, True])
def test_the_heap_gives_the_least_key_first(python):
    push, pop = heap.push, heap.pop
    if python:
        push, pop = push.py_func, pop.py_func
    rng = np.random.default_rng(12)
    queue, count, peer = np.empty(4, np.int64), 0, []
    for _ in range(2000):
        if count and rng.random() < 0.45:
            count -= 1
            assert pop(queue, count) == heapq.heappop(peer)
        else:
            key = int(rng.integers(0, 500))
            queue, count = push(queue, count, key), count + 1
            heapq.heappush(peer, key)
    assert count == len(peer) > 4
    for size in range(1, 100):  # small ones: there a last key without another beside it is moved
        keys = rng.integers(0, 500, 1 + size % 12).tolist()
        for n, key in enumerate(keys):
            queue = push(queue, n, key)
        assert [pop(queue, n) for n in range(len(keys) - 1, -1, -1)] == sorted(keys)
