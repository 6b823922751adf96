import itertools
import math

import numpy as np
import pytest

from tests.planners.worlds import random_points, random_space, row_of_cells
from wayproof.planners import FreeSpace, point_at, truncate


def test_every_point_before_the_free_length_is_free():
    rng = np.random.default_rng(5)
    cut = 0
    for seed in range(40):
        space = random_space(seed, (12, 12, 6))
        path = random_points(rng, space, 4)
        length = space.free_length(path)
        cut += 0.0 < length < np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
        if length > 0.0:
            assert all(space.is_free(point_at(path, s)) for s in np.linspace(0.0, length, 300))
    assert cut > 5


def test_outside_and_senseless_points_are_forbidden():
    space = row_of_cells([4, 4])
    for x in (-1e-9, 2.0, 1e9, math.inf, math.nan):
        away = np.array([x, 0.5, 0.5])
        assert not space.is_free(away)
        assert not space.edge_free(np.array([0.5, 0.5, 0.5]), away)
    assert space.is_free(np.zeros(3))
    path = np.array([[1.5, 0.5, 0.5], [2.5, 0.5, 0.5]])
    assert space.free_length(path) == pytest.approx(0.5, abs=1e-4)
    assert space.least_clearance(path) == 0.0
    assert space.free_length(path[::-1]) == 0.0


def test_nearest_free_takes_the_nearest_then_the_lowest_index():
    field = np.full((5, 5, 1), 9, dtype=np.uint16)
    field[1:4, 1:4] = 0
    space = FreeSpace(field, np.zeros(3), 1.0, 0, np.zeros(10))
    # From the centre four cells are 2 m away: (0, 2), (2, 0), (2, 4), (4, 2).
    assert space.nearest_free(np.array([2.5, 2.5, 0.5]), 2.0).tolist() == [0.5, 2.5, 0.5]
    assert space.nearest_free(np.array([2.5, 2.6, 0.5]), 2.0).tolist() == [2.5, 4.5, 0.5]
    assert space.nearest_free(np.array([2.5, 2.5, 0.5]), 1.9) is None
    assert space.nearest_free(np.array([-0.5, 0.5, 0.5]), 1.0).tolist() == [0.5, 0.5, 0.5]
    assert space.nearest_free(np.array([math.nan, 0.5, 0.5]), 1.0) is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"distances": np.zeros((3, 3), dtype=np.uint16)},
            r"space\.distances: got uint16 \(3, 3\)",
        ),
        ({"origin": np.zeros(2)}, r"space\.origin: got shape \(2,\), expected \(3,\)"),
        ({"resolution": 0.0}, r"space\.resolution: got 0\.0, expected above 0"),
        ({"collision_distance_sq": -1}, r"collision_distance_sq: got -1, expected 0 or more"),
        ({"cost_by_distance": np.array([0.0, np.inf])}, r"space\.cost_by_distance: got \[inf\]"),
    ],
)
def test_wrong_spaces_are_refused(change, message):
    right = {
        "distances": np.ones((3, 3, 1), dtype=np.uint16),
        "origin": np.zeros(3),
        "resolution": 0.1,
        "collision_distance_sq": 0,
        "cost_by_distance": np.zeros(4),
    }
    with pytest.raises(ValueError, match=message):
        FreeSpace(**(right | change))


def test_a_way_cut_short_at_a_corner_of_cells_ends_in_a_free_cell():
    """A diagonal through the corner of a blocked cell, its ends off by what floats round to."""
    field = np.full((200, 200, 1), 100, dtype=np.uint16)
    field[97, 79, 0] = 0
    space = FreeSpace(field, np.array([0.0, 0.0, 0.025]), 0.1, 1, np.zeros(101))
    for off in itertools.product((-4e-15, 0.0, 4e-15), repeat=4):
        a = np.array([9.65 + off[0], 7.85 + off[1], 0.075])
        b = np.array([10.65 + off[2], 8.85 + off[3], 0.075])
        path = np.array([a, b])
        cut = truncate(path, space.free_length(path))
        assert space.edge_free(cut[0], cut[-1])
