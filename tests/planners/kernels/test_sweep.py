import dataclasses
import math

import numpy as np
import pytest

from tests.planners.worlds import long_space, point, random_poses
from wayproof.planners import (
    FreeSpace,
)
from wayproof.planners.kernels import (
    angles,
    sweep,
    sweep_cost,
)


def naive_free(space: FreeSpace, a: np.ndarray, b: np.ndarray) -> bool:
    """Every disc's centre at 400 poses between lies in a free cell of its own."""
    turn = (b[3] - a[3] + math.pi) % (2.0 * math.pi) - math.pi
    for t in np.linspace(0.0, 1.0, 400):
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
