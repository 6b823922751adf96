"""Where a body heads: angles, free lengths, and the cell that ends them."""

import dataclasses
import itertools
import math

import numpy as np
import pytest

from tests.planners.worlds import (
    long_space,
    point,
    random_points,
    random_poses,
    random_space,
    row_of_cells,
)
from wayproof.planners import FreeSpace, point_at
from wayproof.planners.kernels import (
    angles,
    free_box,
    headed,
    segment,
    sweep,
    sweep_cost,
)
from wayproof.planners.kernels.angles import (
    acceleration_limited,
    edge_headings,
    rate_limited,
    wrap,
    yaw_of_direction,
)


def test_headings_equal_the_library_and_python():
    rng = np.random.default_rng(0)
    axes = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (1.0, 1.0), (0.0, 0.0)]
    for x, y in [*axes, *rng.normal(size=(200, 2)).tolist()]:
        assert yaw_of_direction(x, y) == pytest.approx(math.atan2(y, x), abs=1e-12)
        assert yaw_of_direction.py_func(x, y) == yaw_of_direction(x, y)
    for angle in rng.uniform(-20.0, 20.0, 50):
        assert wrap(angle) == wrap.py_func(angle)
        assert math.cos(wrap(angle)) == pytest.approx(math.cos(angle))
        assert -math.pi <= wrap(angle) < math.pi


def test_steep_edges_keep_the_heading_and_turns_are_not_counted_twice():
    tangents = np.array([[0, 0, 1], [0, 1, 0], [-1, 0.01, 0], [-1, -0.01, 0], [0, 0, -1.0]])
    expected = [0.3, math.pi / 2, math.pi - 0.01, math.pi + 0.01, math.pi + 0.01]
    headings = edge_headings(tangents, 0.3)
    assert headings == pytest.approx(expected, abs=1e-4)
    assert edge_headings.py_func(tangents, 0.3).tobytes() == headings.tobytes()
    targets = np.array([0.05, 1.0, 1.0, -1.0])
    turned = rate_limited(targets, 0.0, 0.1)
    assert turned == pytest.approx([0.0, 0.05, 0.15, 0.25, 0.15])
    assert rate_limited.py_func(targets, 0.0, 0.1).tobytes() == turned.tobytes()


def there_and_back(seed):
    """Headings of a path that bends one way and back, and stays there, rad."""
    rng = np.random.default_rng(seed)
    corners = np.cumsum(rng.uniform(-1.3, 1.3, 5))
    return np.repeat(corners, rng.integers(1, 60, 5)).tolist() + [corners[-1]] * 900


@pytest.mark.parametrize("seed", range(8))
def test_headings_change_their_rate_by_no_more_than_the_limit(seed):
    targets = np.array(there_and_back(seed))
    largest_step, largest_change, rate = 0.015, 4e-4, 0.01
    headings = acceleration_limited(targets, 0.2, rate, largest_step, largest_change)
    interpreted = acceleration_limited.py_func(targets, 0.2, rate, largest_step, largest_change)
    assert interpreted.tobytes() == headings.tobytes()
    steps = np.diff(headings, prepend=0.2 - rate)
    assert headings[0] == 0.2
    assert np.abs(steps).max() <= largest_step + 1e-12
    assert np.abs(np.diff(steps)).max() <= largest_change + 1e-12
    assert headings[-1] == pytest.approx(targets[-1], abs=1e-3)
    overshoot = np.abs(headings[-200:] - targets[-1]).max()
    assert overshoot < 0.02


def test_a_heading_that_turns_evenly_is_followed_without_a_lag():
    targets = 0.01 * np.arange(1.0, 400.0)
    headings = acceleration_limited(targets, 0.0, 0.0, 0.015, 4e-4)
    assert headings[-1] == pytest.approx(targets[-1], abs=1e-3)


def test_directions_equal_the_library_and_python():
    for angle in np.random.default_rng(0).uniform(-20.0, 20.0, 200):
        found = angles.cosine_sine(angle)
        assert found == pytest.approx((math.cos(angle), math.sin(angle)), abs=1e-13)
        assert angles.cosine_sine.py_func(angle) == found


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


def naive_free(space: FreeSpace, a: np.ndarray, b: np.ndarray) -> bool:
    """Every disc's centre at 100 poses between lies in a free cell of its own."""
    turn = (b[3] - a[3] + math.pi) % (2.0 * math.pi) - math.pi
    for t in np.linspace(0.0, 1.0, 100):
        x, y, z, heading = *(a[:3] + t * (b[:3] - a[:3])), a[3] + t * turn
        for disc in space.discs:
            centre = [x + disc.offset * math.cos(heading), y + disc.offset * math.sin(heading), z]
            alone = dataclasses.replace(
                space, discs=(), collision_distance_sq=disc.collision_distance_sq
            )
            if not alone.is_free(np.array(centre)):
                return False
    return True


def test_sweeps_are_free_only_where_every_pose_is():
    rng = np.random.default_rng(3)
    space = long_space(rng.random((60, 60, 1)) < 0.004)
    space = dataclasses.replace(space, cost_by_distance=np.zeros(201))
    verdicts = []
    for a, b in random_poses(space, 120, 5).reshape(60, 2, 4):
        b[:3] = a[:3] + 0.15 * (b[:3] - a[:3])
        free = space.sweep_free(a, b)
        if free:
            assert naive_free(space, a, b)
            length, turn = math.dist(a[:3], b[:3]), abs(angles.wrap(b[3] - a[3]))
            assert space.free_sweep_length(np.array([a, b])) == pytest.approx(length)
            cost = space.sweep_cost(np.array([a, b]))
            price = sweep_cost.TURN_COST * turn
            assert length + price <= cost <= (1 + 2 * sweep_cost.SIDEWAYS) * length + price + 1e-9
        else:
            assert space.sweep_cost(np.array([a, b])) == math.inf
        verdicts.append(free)
    assert 5 < sum(verdicts) < 55


def test_the_first_place_that_sweeps_lead_to(bend):
    start = (*point(bend, 12.5, 14.5).tolist(), 0.3)
    places = np.array([point(bend, x, y)[:2] for x, y in ((12.5, 11.5), (13.5, 14.5))])
    headings = np.arange(16) * math.pi / 8.0
    place, free = sweep.free_headings(bend.grid, bend.shape, start, places, headings)
    python = sweep.free_headings.py_func(bend.grid, bend.shape, start, places, headings)
    assert python[0] == place == 1
    assert python[1].tobytes() == free.tobytes()
    for (m, gear), one in np.ndenumerate(free):
        there = angles.wrap(headings[m] + gear * math.pi)
        near = gear == 0 or abs(angles.wrap(there - 0.3)) <= 0.5 * math.pi
        pose = np.array([*places[1], start[2], there])
        assert one == (near and bend.sweep_free(np.array(start), pose))
    assert 0 < free.sum() < 16


def test_poses_are_counted_up_to_the_first_that_does_not_fit(bend):
    start, far = point(bend, 12.5, 14.5), point(bend, 33.5, 14.5)
    poses = np.array([[*start, 0.0], [*far, 0.0], [*far, 1.3], [*start, 1.3]])
    assert bend.free_poses(poses[:2]) == 2
    assert bend.free_poses(poses[::-1]) == 0  # across the lane
    count = bend.free_poses(poses)
    assert sweep.walk_poses.py_func(bend.grid, bend.shape, poses)[1] == count < 4


def test_the_nearest_pose(bend):
    wall = point(bend, 15.5, 12.0)
    along, across = np.zeros(1), np.full(1, 0.5 * math.pi)
    found = bend.nearest_pose(wall, 0.5, along)
    assert bend.pose_free(found[:3], found[3])
    assert found[0] == pytest.approx(wall[0])
    assert bend.nearest_pose(wall, 0.5, across) is None
    arguments = bend.grid, bend.shape, (*wall.tolist(), 0.0), 5.0, along
    python = sweep.nearest_pose.py_func(*arguments)
    assert python == sweep.nearest_pose(*arguments)
