"""Shortcuts of paths and of poses, and the kernels below them."""

import itertools
import math

import numpy as np
import pytest

from tests.planners.worlds import long_space, point, random_poses, random_space
from wayproof.planners import FreeSpace, PlannerConfig, plan
from wayproof.planners.kernels import (
    pose_shortcut,
    segment,
    shortcut,
    sweep_cost,
)


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


@pytest.mark.parametrize("python", [False, True])
def test_is_cheaper_is_the_sum_of_the_sweeps(python):
    cheaper = pose_shortcut.is_cheaper.py_func if python else pose_shortcut.is_cheaper
    rng = np.random.default_rng(13)
    space = long_space(rng.random((60, 60, 1)) < 0.003)
    grid, discs, verdicts = space.grid, space.shape, []
    size = np.array(space.distances.shape[:2]) * space.resolution
    for k in range(100 if python else 600):
        places = space.origin[:2] + rng.uniform(0.2, 0.8, (3, 2)) * size
        u, apex, v = (
            (float(x), float(y), float(space.origin[2]), float(h))
            for (x, y), h in zip(places, rng.uniform(-3.0, 3.0, 3), strict=True)
        )
        poses = np.empty((8, 4))
        poses[0] = u
        end = pose_shortcut.write_detour(u, apex[:3], v, bool(k % 2), poses)
        poses[end] = v
        edges = zip(poses[:end].tolist(), poses[1 : end + 1].tolist(), strict=True)
        cost = sum(sweep_cost.sweep_cost(grid, discs, 2.0, tuple(a), tuple(b)) for a, b in edges)
        length = sum(math.dist(a[:3], b[:3]) for a, b in itertools.pairwise(poses[: end + 1]))
        for than in (cost - 1e-6, cost + 1e-6, cost + 0.1, length + 0.3):
            verdicts.append(cheaper(grid, discs, 2.0, poses[: end + 1], than))
            assert verdicts[-1] == (cost < than)
    assert 10 < sum(verdicts) < len(verdicts) - 10


def test_compiled_pose_kernels_equal_python():
    space = long_space(np.random.default_rng(3).random((60, 60, 1)) < 0.003)
    for a, b in random_poses(space, 40, 6).reshape(20, 2, 4):
        pair = (space.grid, space.shape, 2.0, tuple(a.tolist()), tuple(b.tolist()))
        assert sweep_cost.sweep_cost.py_func(*pair) == sweep_cost.sweep_cost(*pair)
    start, goal = point(space, 8.5, 8.5), point(space, 50.5, 50.5)
    settings = PlannerConfig("rrtconnect", restarts=1, shortcuts=0)
    found = plan(space, start, goal, settings, seed=2)
    poses = np.column_stack((found.waypoints, found.headings))
    draws = np.random.default_rng(0).uniform(0.0, 1.0, (20, 5)) * [1, 1, 1, 1, 0]
    short = pose_shortcut.shortcut_poses(space.grid, space.shape, 2.0, poses, draws)
    python = pose_shortcut.shortcut_poses.py_func(space.grid, space.shape, 2.0, poses, draws)
    assert python.tobytes() == short.tobytes()
    assert space.sweep_cost(short) < space.sweep_cost(poses)
    assert np.array_equal(short[[0, -1]], poses[[0, -1]])
