"""The cell that ends a free length, against the length itself."""

import itertools

import numpy as np
import pytest

from tests.planners.worlds import long_space, point, random_points, random_space, row_of_cells
from wayproof.planners import point_at
from wayproof.planners.kernels import headed, segment, sweep


def forbidden(space, cell):
    inside = ((cell >= 0) & (cell < space.distances.shape)).all()
    return not inside or space.distances[tuple(cell)] <= space.collision_distance_sq


def test_it_is_forbidden_and_right_where_the_free_length_ends():
    rng = np.random.default_rng(7)
    ended = 0
    for seed in range(60):
        space = random_space(seed, (12, 12, 6))
        path = random_points(rng, space, 4)
        length, cell = space.free_length(path), space.first_forbidden(path)
        threshold = space.collision_distance_sq
        found = segment.walk_path.py_func(space.grid, threshold, 0.0, path)
        assert (cell is not None) == (found[1] <= threshold)
        if cell is None:
            whole = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
            assert length == pytest.approx(whole)
            continue
        ended += 1
        assert cell.tolist() == list(found[3])
        assert forbidden(space, cell)
        at = (point_at(path, length) - space.origin) / space.resolution
        assert np.abs(np.clip(at, cell, cell + 1) - at).max() < 1e-3
    assert ended > 30


@pytest.mark.parametrize("corner", [(1, 0), (0, 1), (1, 1)])
def test_a_path_through_a_corner_of_cells_touches_all_of_them(corner):
    space = random_space(0, (9, 9, 1), share=0.0)
    space.distances[4 + corner[0], 4 + corner[1]] = 0
    path = space.origin + space.resolution * np.array([[4.5, 4.5, 0.5], [5.5, 5.5, 0.5]])
    assert space.first_forbidden(path).tolist() == [4 + corner[0], 4 + corner[1], 0]


def test_beyond_the_grid_all_is_forbidden():
    space = row_of_cells([4, 4])
    path = np.array([[1.5, 0.5, 0.5], [2.5, 0.5, 0.5]])
    assert space.first_forbidden(path).tolist() == [2, 0, 0]
    assert space.first_forbidden(path[:1]) is None


def test_a_long_body_is_stopped_where_its_free_length_ends():
    ended = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        space = long_space(rng.random((60, 60, 1)) < 0.006)
        corners = np.array([point(space, x, y) for x, y in rng.uniform(8.0, 52.0, size=(5, 2))])
        t = np.linspace(0.0, 1.0, 20)[:-1, None]
        path = np.vstack([a + t * (b - a) for a, b in itertools.pairwise(corners)])
        whole = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
        cell = space.first_forbidden(path)
        found = headed.walk_headed.py_func(space.grid, space.shape, path)
        assert (cell is None) == (space.free_length(path) > whole - 1e-9) == (not found[1])
        if cell is not None:
            ended += 1
            assert cell.tolist() == list(found[2])
            assert space.distances[tuple(cell)] <= max(space.shape.thresholds)
    assert ended > 3


def test_the_first_pose_that_cannot_be_reached():
    blocked = np.zeros((60, 30, 1), bool)
    blocked[40] = True
    space = long_space(blocked)
    poses = np.array([[*point(space, x, 15.5), 0.0] for x in (10.5, 20.5, 30.5, 50.5)])
    reached, cell = space.first_forbidden_pose(poses)
    assert reached == space.free_poses(poses) == 3
    assert space.distances[tuple(cell)] <= max(space.shape.thresholds)
    assert space.first_forbidden_pose(poses[:2]) == (1, None)
    assert sweep.walk_poses.py_func(space.grid, space.shape, poses)[1] == 3
