import itertools
import math

import numpy as np
import pytest

from tests.planners.worlds import long_space, point
from wayproof.planners import FreeSpace
from wayproof.planners.kernels import (
    angles,
    free_box,
    headed,
)


def naive_headed_length(space: FreeSpace, path: np.ndarray) -> float:
    """Every step of every sweep looked at, in Python."""
    length, heading = 0.0, None
    for a, b in itertools.pairwise(path):
        ahead = angles.yaw_of_direction(b[0] - a[0], b[1] - a[1])
        for facing in (ahead, ahead + math.pi):
            poses = np.array([[*a, facing], [*b, facing]])
            if heading is not None:
                poses = np.vstack(([[*a, heading]], poses))
            if space.free_sweep_length(poses) >= math.dist(a, b) - 1e-9 and _turns(space, poses):
                heading = facing
                break
        else:
            return length
        length += math.dist(a, b)
    return length


def _turns(space: FreeSpace, poses: np.ndarray) -> bool:
    share = np.linspace(0.0, 1.0, 200)
    turn = angles.wrap(poses[1, 3] - poses[0, 3])
    if len(poses) == 2:
        return space.pose_free(poses[0, :3], poses[0, 3])
    return all(space.pose_free(poses[0, :3], poses[0, 3] + s * turn) for s in share)


def test_edges_in_free_boxes_are_free_one_by_one():
    partly = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        space = long_space(rng.random((60, 60, 1)) < 0.006)
        corners = np.array([point(space, x, y) for x, y in rng.uniform(8.0, 52.0, size=(5, 2))])
        t = np.linspace(0.0, 1.0, 20)[:-1, None]
        path = np.vstack([a + t * (b - a) for a, b in itertools.pairwise(corners)])
        found = space.free_length(path)
        assert found == headed.walk_headed.py_func(space.grid, space.shape, path)[0]
        assert found == pytest.approx(naive_headed_length(space, path), abs=1e-9)
        partly += 0.0 < found < 1.0
        low, high = tuple(path[:4].min(axis=0)), tuple(path[:4].max(axis=0))
        box = free_box.box_free(space.grid, 7, low, high, 0.3)
        reach = np.array([0.3, 0.3, 0.0])
        first = np.floor((np.array(low) - reach - space.origin) / 0.1).astype(int)
        last = np.floor((np.array(high) + reach - space.origin) / 0.1).astype(int)
        cells = space.distances[first[0] - 1 : last[0] + 2, first[1] - 1 : last[1] + 2]
        assert box == bool((cells > 7).all())
        assert free_box.box_free.py_func(space.grid, 7, low, high, 0.3) == box
    assert partly > 0


def test_the_length_along_which_a_body_heads(bend):
    lane = np.array([point(bend, 12.5, 14.5), point(bend, 22.5, 14.5), point(bend, 32.5, 14.5)])
    assert bend.free_length(lane) == pytest.approx(2.0)
    assert bend.free_length(lane[::-1]) == pytest.approx(2.0)  # nose or tail first
    across = np.vstack((lane[:2], point(bend, 22.5, 16.5)))
    assert bend.free_length(across) == pytest.approx(1.0)  # it cannot turn there
    python = headed.walk_headed.py_func(bend.grid, bend.shape, across)[0]
    assert python == bend.free_length(across)
