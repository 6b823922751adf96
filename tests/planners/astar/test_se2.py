import math

import numpy as np

from tests.planners.worlds import long_space, point
from wayproof.planners import Body, PlannerConfig, plan
from wayproof.planners.astar.se2 import reversible, se2_path


def bits(value: object) -> list[float]:
    return np.asarray(value, dtype=np.float64).tolist()


def test_a_body_gets_round_a_bend_that_its_disc_does_not(bend):
    start, goal = point(bend, 12.5, 14.5), point(bend, 35.5, 48.5)
    poses = se2_path(bend, (*start, 0.0), (*goal, 0.0), 10**6)
    assert poses is not None
    assert bend.free_poses(poses) == len(poses)
    assert bits(poses[0, :3]) == bits(start)
    assert bits(poses[-1, :3]) == bits(goal)
    found = plan(bend, start, goal, PlannerConfig(), seed=1)
    assert found.label == "none"
    again = plan(bend, start, goal, PlannerConfig(), seed=1)
    assert again.waypoints.tobytes() == found.waypoints.tobytes()


def test_it_backs_out_of_a_dead_end(bend):
    blocked = np.zeros((60, 30, 1), dtype=bool)
    blocked[:30, :10] = blocked[:30, 19:] = True
    space = long_space(blocked)
    start, goal = point(space, 8.5, 14.5), point(space, 50.5, 14.5)
    poses = se2_path(space, (*start, math.pi), (*goal, 0.0), 10**6)
    inside = poses[poses[:, 0] < point(space, 24, 0)[0]]
    assert len(inside) > 1
    assert np.abs(np.cos(inside[:, 3]) + 1.0).max() < 0.15  # tail first, where it cannot turn


def test_without_a_way_or_a_node_there_is_no_path(bend):
    blocked = np.zeros((60, 30, 1), dtype=bool)
    blocked[30] = True
    space = long_space(blocked)
    start, goal = (*point(space, 8.5, 14.5), 0.0), (*point(space, 50.5, 14.5), 0.0)
    assert se2_path(space, start, goal, 10**6) is None
    assert se2_path(space, start, (*point(space, 30.5, 14.5), 0.0), 10**6) is None


def test_only_bodies_as_long_behind_as_ahead_go_tail_first(bend):
    assert reversible(bend)
    assert not reversible(long_space(np.zeros((9, 9, 1), bool), Body((0.0, 0.3), (0.2, 0.2))))
