import math

import numpy as np

from tests.planners.worlds import make_space, point
from wayproof.planners.kernels import free_box


def test_a_box_is_free_where_all_its_cells_are():
    rng = np.random.default_rng(6)
    space = make_space(rng.random((14, 12, 5)) < 0.003, resolution=0.25)
    shape = np.array(space.distances.shape)
    free = seen = 0
    for _ in range(600):
        low, size = rng.uniform(0.5, shape - 1.0), rng.uniform(0.0, (4.0, 4.0, 2.0))
        corners = [tuple(space.origin + space.resolution * end) for end in (low, low + size)]
        reach = rng.uniform(0.0, 2.0)
        all_free = free_box.box_free(space.grid, 2, *corners, reach * space.resolution)
        first = np.floor(low - (reach, reach, 0.0)).astype(int) - 1
        end = np.floor(low + size + (reach, reach, 0.0)).astype(int) + 2
        inside = (first >= 0).all() and (end <= shape).all()
        cells = tuple(slice(a, b) for a, b in zip(first, end, strict=True))
        assert all_free == (inside and bool((space.distances[cells] > 2).all()))
        assert (
            free_box.box_free.py_func(space.grid, 2, *corners, reach * space.resolution) == all_free
        )
        free, seen = free + all_free, seen + inside
    assert 20 < free < seen - 20


def test_a_distance_decides_exactly_about_cells_near_it():
    for value, threshold, squared in np.ndindex(60, 12, 12):
        beyond = math.sqrt(value) - math.sqrt(threshold) - math.sqrt(squared)
        assert free_box.all_above(value, threshold, squared) == (beyond > 1e-9)


def test_a_box_that_leaves_the_grid_is_not_free(bend):
    empty = make_space(np.zeros((20, 20, 1), dtype=bool))
    middle = tuple(point(empty, 10, 10).tolist())
    assert free_box.box_free(empty.grid, 4, middle, middle, 0.8)
    assert not free_box.box_free(empty.grid, 4, middle, middle, 1.0)
    assert not free_box.box_free(empty.grid, 4, (math.nan, 0.0, 0.0), middle, 0.1)
