import itertools
import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from tests.planners.worlds import random_points, random_space, row_of_cells
from wayproof.planners import FreeSpace
from wayproof.planners.kernels import grid, segment

SUBCELLS = grid.SUBCELLS


def touched_cells(space: FreeSpace, a: np.ndarray, b: np.ndarray) -> dict[tuple, tuple]:
    """Every half-open cell on the segment, and those around a crossing, with their time span.

    Written with rationals: the segment is cut at all its crossings of cell faces.
    """
    start, end = (
        [Fraction(math.floor((x - low) / space.resolution * SUBCELLS), SUBCELLS) for x, low in
         zip(p, space.origin, strict=True)]
        for p in (a, b)
    )  # fmt: skip
    times = {Fraction(0), Fraction(1)}
    for p, q in zip(start, end, strict=True):
        low, high = sorted((p, q))
        if p != q:
            faces = range(math.ceil(low), math.floor(high) + 1)
            times |= {(face - p) / (q - p) for face in faces}
    times = sorted(times)
    at = {t: [p + t * (q - p) for p, q in zip(start, end, strict=True)] for t in times}
    spans: dict[tuple, tuple] = {}
    for t in times:  # the points where faces are crossed, with all the cells that meet there
        before = after = tuple(math.floor(x) for x in at[t])
        index = times.index(t)
        if index > 0:
            before = cell_of_middle(at[times[index - 1]], at[t])
        if index + 1 < len(times):
            after = cell_of_middle(at[t], at[times[index + 1]])
        here = tuple(math.floor(x) for x in at[t])
        for cell in {here, *itertools.product(*(sorted({p, q, r}) for p, q, r in
                     zip(before, here, after, strict=True)))}:  # fmt: skip
            spans.setdefault(cell, (t, t))
    for t, u in itertools.pairwise(times):
        cell = cell_of_middle(at[t], at[u])
        spans[cell] = (min(t, spans[cell][0]), u) if cell in spans else (t, u)
    return spans


def cell_of_middle(p: list[Fraction], q: list[Fraction]) -> tuple[int, ...]:
    return tuple(math.floor((x + y) / 2) for x, y in zip(p, q, strict=True))


def field_value(space: FreeSpace, cell: tuple[int, ...]) -> int:
    inside = all(0 <= index < size for index, size in zip(cell, space.distances.shape, strict=True))
    return int(space.distances[cell]) if inside else -1


def naive_walk(space: FreeSpace, a: np.ndarray, b: np.ndarray) -> tuple[int, float, float]:
    """Least field value, share before the first forbidden cell, and mean cost if all is free."""
    spans = touched_cells(space, a, b)
    least = min(field_value(space, cell) for cell in spans)
    blocked = [span[0] for cell, span in spans.items() if field_value(space, cell) <= 0]
    share = float(min(blocked, default=Fraction(1)))
    cost = 0.0
    if least > 0:
        cost = sum(float(u - t) * cell_cost(space, c) for c, (t, u) in spans.items())
    return least, share, cost


def cell_cost(space: FreeSpace, cell: tuple[int, ...]) -> float:
    price = space.prices[cell]
    return space.cost_by_price[price] if price else 1.0 / (1.0 + field_value(space, cell))


@pytest.mark.parametrize("shape", [(12, 9, 1), (8, 7, 6)])
def test_walks_touch_exactly_the_cells_that_geometry_says(shape):
    rng = np.random.default_rng(1)
    verdicts = []
    for seed in range(6):
        prices = rng.integers(0, 3, shape).astype(np.uint8)
        space = replace(random_space(seed, shape), prices=prices, cost_by_price=(0.0, 0.7, 2.5))
        a, b = random_points(rng, space, 120).reshape(2, 60, 3)
        if shape[2] == 1:
            a[:, 2] = b[:, 2] = space.origin[2] + 0.5 * space.resolution
        for p, q in zip(a, b, strict=True):
            least, share, cost = naive_walk(space, p, q)
            length = float(np.linalg.norm(q - p))
            path = np.array([p, q])
            assert space.edge_free(p, q) == space.edge_free(q, p) == (least > 0)
            assert space.least_clearance(path) == math.sqrt(max(least, 0)) * space.resolution
            assert space.free_length(path) <= share * length + 1e-12
            if least > 0:
                assert space.path_cost(path, 3.0) == pytest.approx(length * (1.0 + 3.0 * cost))
            else:
                assert space.path_cost(path, 3.0) == math.inf
            verdicts.append(least > 0)
    assert 20 < sum(verdicts) < len(verdicts) - 20


def test_compiled_kernels_equal_python():
    rng = np.random.default_rng(2)
    space = random_space(3, (10, 10, 5), share=0.03)
    for path in random_points(rng, space, 80).reshape(20, 4, 3):
        a, b = tuple(path[0].tolist()), tuple(path[1].tolist())
        near, start = grid.to_subcells(space.grid, a)
        assert grid.to_subcells.py_func(space.grid, a) == (near, start)
        end = grid.to_subcells(space.grid, b)[1]
        walked = segment.walk(space.grid, 0, start, end)
        assert segment.walk.py_func(space.grid, 0, start, end) == walked
        walked = segment.walk_path(space.grid, 0, 2.0, path)
        assert segment.walk_path.py_func(space.grid, 0, 2.0, path) == walked
        nearest = segment.nearest_free(space.grid, 5, a, 2.5)
        assert segment.nearest_free.py_func(space.grid, 5, a, 2.5) == nearest


def test_a_walk_is_the_one_that_looks_out_for_corners_and_borders():
    rng = np.random.default_rng(5)
    walked = 0
    for seed in range(20):
        space = random_space(seed, (9, 8, 4), share=0.05)
        for k in range(200):
            # On faces and corners too, and beyond the grid.
            ends = rng.integers(-2, 22, (2, 3)) * (grid.SUBCELLS // 2)
            ends += rng.integers(-1, 2, (2, 3)) * rng.integers(0, grid.SUBCELLS // 3, (2, 3))
            if k % 2:
                ends[1, 2] = ends[0, 2]
            a, b = (tuple(end.tolist()) for end in ends)
            for threshold in (0, 3):
                walk = segment.walk_anywhere(space.grid, threshold, a, b)
                assert segment.walk_anywhere.py_func(space.grid, threshold, a, b) == walk
                assert segment.walk(space.grid, threshold, a, b) == walk
                assert segment.walk.py_func(space.grid, threshold, a, b) == walk
                walked += walk[0] == 1.0 and a != b
    assert 100 < walked < 15000


def test_a_row_of_cells_by_hand():
    space = row_of_cells([4, 2, 3, 0, 4])
    path = np.array([[0.5, 0.5, 0.5], [3.5, 0.5, 0.5]])
    assert space.free_length(path) == pytest.approx(2.5, abs=1e-4)
    assert space.free_length(path) < 2.5
    assert space.path_cost(path) == math.inf
    free = np.array([[0.5, 0.5, 0.5], [2.5, 0.5, 0.5]])
    # 0.5 m at 0, 1 m at 0.5 and 0.5 m at 0.25, times 2, on top of the length
    assert space.path_cost(free, 2.0) == pytest.approx(2.0 + 2.0 * (0.5 + 0.125))
    assert space.free_length(free) == 2.0
    assert space.least_clearance(free) == math.sqrt(2.0)


def test_a_corner_touches_all_its_cells():
    field = np.full((2, 2, 1), 9, dtype=np.uint16)
    field[0, 1] = 0
    space = FreeSpace(field, np.zeros(3), 1.0, 0, np.zeros(10))
    corner = np.array([[0.5, 0.5, 0.5], [1.5, 1.5, 0.5]])
    assert not space.edge_free(*corner)
    assert space.edge_free(corner[0] + [0.01, 0.0, 0.0], corner[1] + [0.01, 0.0, 0.0])
