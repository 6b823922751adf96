import numpy as np
import pytest

from tests.planners.worlds import random_space
from wayproof.planners import FreeSpace
from wayproof.planners.kernels import segment, shortcut


def test_compiled_shortcut_equals_python():
    space = random_space(3, (20, 20, 1), share=0.0)
    path = space.origin + space.resolution * np.array([[1, 1, 0.5], [18, 2, 0.5], [17, 18, 0.5]])
    draws = np.random.default_rng(0).uniform(0.0, 1.0, (40, 5)) * [1, 1, 1, 1, 0]
    short = shortcut.shortcut(space.grid, 0, 2.0, 0.2, path, draws)
    assert (
        shortcut.shortcut.py_func(space.grid, 0, 2.0, 0.2, path, draws).tobytes() == short.tobytes()
    )
    assert space.path_cost(short, 2.0) < space.path_cost(path, 2.0)
    assert np.array_equal(short[[0, -1]], path[[0, -1]])


def test_the_fewest_corners_are_kept_that_their_price_is_worth():
    field = np.full((100, 100, 1), 100, dtype=np.uint16)
    space = FreeSpace(field, np.zeros(3), 0.1, 1, np.zeros(101))
    bow = np.array([[1.0, 1.0, 0.05], [3.0, 1.3, 0.05], [5.0, 1.3, 0.05], [7.0, 1.0, 0.05]])
    field[38:42, :12, 0] = 0  # the straight way is closed up to y = 1.2 m
    space = FreeSpace(field, np.zeros(3), 0.1, 1, np.zeros(101))

    def kept(price):
        path = shortcut.fewest_corners(space.grid, 1, 0.0, price, bow)
        slow = shortcut.fewest_corners.py_func(space.grid, 1, 0.0, price, bow)
        assert path.tobytes() == slow.tobytes()
        return path[:, 0].tolist()

    # One corner is enough where its edges pass the wall; two are shorter by less than 0.1 m.
    naive = {
        tuple(chosen): segment.walk_path(space.grid, 1, 0.0, bow[list(chosen)])
        for chosen in ((0, 3), (0, 1, 3), (0, 2, 3), (0, 1, 2, 3))
    }
    for price in (0.0, 0.01, 0.5):
        costs = {
            chosen: cost + price * (len(chosen) - 2)
            for chosen, (_, least, cost, _) in naive.items()
            if least > 1
        }
        best = min(costs.values())
        chosen = [n for n, x in enumerate(bow[:, 0]) if x in kept(price)]
        assert costs[tuple(chosen)] == pytest.approx(best, abs=1e-8)
