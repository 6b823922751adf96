import heapq
import itertools
import math

import numpy as np
import pytest

from wayproof.harness.bench.published.voxel_search import (
    SQRT2,
    SQRT3,
    VoxelSearch,
    _length,
    _search,
)


def naive_length(occupied, start, goal):
    """Dijkstra over the same moves, each checked cell by cell."""
    steps = [step for step in itertools.product((-1, 0, 1), repeat=3) if any(step)]
    best, queue = {start: 0.0}, [(0.0, start)]
    while queue:
        length, cell = heapq.heappop(queue)
        if cell == goal:
            return length
        if length > best[cell]:
            continue
        for step in steps:
            other = tuple(np.add(cell, step).tolist())
            if not all(0 <= a < n for a, n in zip(other, occupied.shape, strict=True)):
                continue
            box = [slice(min(a, b), max(a, b) + 1) for a, b in zip(cell, other, strict=True)]
            through = length + math.dist(cell, other)
            if not occupied[tuple(box)].any() and through < best.get(other, math.inf) - 1e-12:
                best[other] = through
                heapq.heappush(queue, (through, other))
    return None


@pytest.mark.parametrize("seed", range(6))
def test_the_search_is_as_short_as_a_naive_one(seed):
    rng = np.random.default_rng(seed)
    occupied = rng.uniform(size=(9, 8, 7)) < (0.1, 0.3, 0.5)[seed % 3]
    free = np.argwhere(~occupied).tolist()
    search = VoxelSearch(occupied)
    for _ in range(4):
        start, goal = (tuple(free[n]) for n in rng.integers(len(free), size=2))
        expected, found = naive_length(occupied, start, goal), search.solve(start, goal)
        assert (found is None) == (expected is None)
        if found is not None:
            assert found.length == pytest.approx(expected, abs=1e-9)
            assert found == search.solve(start, goal)  # whatever was searched before


def test_counts_by_hand():
    # (0, 0, 0) to (4, 2, 1): one step along all axes, one along two, two along one.
    found = VoxelSearch(np.zeros((5, 5, 5), bool)).solve((0, 0, 0), (4, 2, 1))
    assert found[:3] == (2, 1, 1)
    assert found.length == 2.0 + SQRT2 + SQRT3
    with pytest.raises(ValueError, match="goal"):
        VoxelSearch(np.zeros((5, 5, 5), bool)).solve((0, 0, 0), (5, 0, 0))


def test_no_corner_is_cut():
    occupied = np.zeros((2, 2, 1), bool)
    occupied[1, 0, 0] = True
    assert VoxelSearch(occupied).solve((0, 0, 0), (1, 1, 0))[:3] == (2, 0, 0)
    occupied[0, 1, 0] = True
    assert VoxelSearch(occupied).solve((0, 0, 0), (1, 1, 0)) is None


def test_compiled_and_plain_search_agree():
    occupied = np.random.default_rng(3).uniform(size=(6, 6, 6)) < 0.3
    occupied[0, 0, 0] = occupied[5, 5, 5] = False
    search = VoxelSearch(occupied)
    compiled = search.solve((0, 0, 0), (5, 5, 5))
    counts, state = np.zeros((216, 3), np.uint32), np.zeros(216, np.uint32)
    given = (search._allowed, occupied.shape, 0, 215, counts, state, 2)
    assert _search.py_func(*given) == compiled.expanded
    assert tuple(counts[215]) == compiled[:3]
    assert _length.py_func(1, 1, 1) == _length(1, 1, 1)
