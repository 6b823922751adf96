import dataclasses
import math

import numpy as np
import pytest

from planners import Body, FreeSpace, PlannerConfig, kernels, plan
from planners import _heading_kernels as heading_kernels
from planners.headings import LENGTHS, STEPS, _ways, reversible, turning_path
from tests.planners.worlds import make_space, point

BODY = Body((-0.3, 0.0, 0.3), (0.2, 0.2, 0.2))


def long_space(blocked: np.ndarray, body: Body = BODY) -> FreeSpace:
    space = make_space(blocked)
    discs = body.discs(0.0, space.resolution, flat=True)
    least = min(disc.blocked_at_or_below for disc in discs)
    return dataclasses.replace(space, blocked_at_or_below=least, discs=discs)


@pytest.fixture(scope="module")
def bend() -> FreeSpace:
    """A lane 0.9 m wide that bends by a right angle over a chamfer; the body's disc needs 1.1 m."""
    blocked = np.ones((60, 60, 1), dtype=bool)
    blocked[5:40, 10:19] = False
    blocked[31:40, 10:55] = False
    for k in range(8):
        blocked[23 + k : 32, 19 + k] = False
    return long_space(blocked)


def bits(value: object) -> list[float]:
    return np.asarray(value, dtype=np.float64).tolist()


def test_a_body_gets_round_a_bend_that_its_disc_does_not(bend):
    start, goal = point(bend, 12.5, 14.5), point(bend, 35.5, 48.5)
    poses = turning_path(bend, (*start, 0.0), (*goal, 0.0), 10**6)
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
    poses = turning_path(space, (*start, math.pi), (*goal, 0.0), 10**6)
    inside = poses[poses[:, 0] < point(space, 24, 0)[0]]
    assert len(inside) > 1
    assert np.abs(np.cos(inside[:, 3]) + 1.0).max() < 0.15  # tail first, where it cannot turn


def test_no_way_and_no_node_are_told(bend):
    blocked = np.zeros((60, 30, 1), dtype=bool)
    blocked[30] = True
    space = long_space(blocked)
    start, goal = (*point(space, 8.5, 14.5), 0.0), (*point(space, 50.5, 14.5), 0.0)
    assert turning_path(space, start, goal, 10**6) is None
    assert turning_path(space, start, (*point(space, 30.5, 14.5), 0.0), 10**6) is None


def test_only_bodies_as_long_behind_as_ahead_go_tail_first(bend):
    assert reversible(bend)
    assert not reversible(long_space(np.zeros((9, 9, 1), bool), Body((0.0, 0.3), (0.2, 0.2))))


def test_tables_by_hand():
    ways = _ways((0.0,), 1)
    assert ways.lengths.tolist() == [LENGTHS[x * x + y * y] for x, y in STEPS]
    cells = [
        set(map(tuple, row[:n].tolist()))
        for row, n in zip(ways.step_cells, ways.step_counts, strict=True)
    ]
    assert cells[0] == {(0, 0), (1, 0)}
    assert cells[2] == {(0, 0), (1, 0), (0, 1), (1, 1)}  # through the corner of four
    assert cells[1] == {(0, 0), (1, 0), (1, 1), (2, 1)}
    assert ways.turn_counts.tolist() == [1] * 16  # the centre of the body stays


def test_costs_to_go_equal_relaxation_until_nothing_changes():
    rng = np.random.default_rng(1)
    space = long_space(rng.random((14, 15, 1)) < 0.01)
    rates = np.full(201, 8, np.int32)
    rates[:40] = 16
    plane = heading_kernels.Plane(
        space.field[:, :, 0], space.blocked_at_or_below, rates, 1, (14, 15)
    )
    ways = _ways((0.0,), 1)
    free = plane.field > plane.threshold
    goal = int(np.flatnonzero(free.ravel())[5])
    every = np.flatnonzero(free.ravel())
    found = heading_kernels.costs_to_go(plane, ways, goal, every)
    naive = np.full((14, 15), heading_kernels.UNKNOWN_COST)
    naive.ravel()[goal] = 0
    changed = True
    while changed:
        before = naive.copy()
        for i, j in np.argwhere(free):
            for (x, y), length in zip(STEPS, ways.lengths, strict=True):
                u, v = i + x, j + y
                if 0 <= u < 14 and 0 <= v < 15 and free[u, v]:
                    pair = rates[plane.field[i, j]] + rates[plane.field[u, v]]
                    naive[i, j] = min(naive[i, j], naive[u, v] + (int(length) * int(pair) >> 1))
        changed = bool((naive != before).any())
    reached = naive.ravel() < heading_kernels.UNKNOWN_COST
    assert (found[reached & free.ravel()] == naive.ravel()[reached & free.ravel()]).all()
    python = heading_kernels.costs_to_go.py_func(plane, ways, goal, every)
    assert python.tobytes() == found.tobytes()


def test_compiled_search_equals_python(bend):
    blocked = np.zeros((24, 20, 1), dtype=bool)
    blocked[12, :10] = True
    space = long_space(blocked)
    rates = np.full(201, 8, np.int32)
    plane = heading_kernels.Plane(
        space.field[:, :, 0], space.blocked_at_or_below, rates, 1, (24, 20)
    )
    ways = _ways(tuple(disc.offset / space.resolution for disc in space.discs), 1)
    ways = ways._replace(turn_price=40, reversal_price=900)
    goal, starts = 18 * 20 + 8, np.array([(5 * 20 + 8) * 16])
    to_go = heading_kernels.costs_to_go(plane, ways, goal, starts // 16)
    arguments = plane, ways, to_go, starts, np.zeros(1, np.int64), goal, 10**6
    states = heading_kernels.search_states(*arguments)
    assert states[0] == starts[0]
    assert states[-1] // 16 == goal
    assert heading_kernels.search_states.py_func(*arguments).tobytes() == states.tobytes()
    assert len(heading_kernels.search_states(*arguments[:-1], 3)) == 0


def test_poses_are_counted_up_to_the_first_that_does_not_fit(bend):
    start, far = point(bend, 12.5, 14.5), point(bend, 33.5, 14.5)
    poses = np.array([[*start, 0.0], [*far, 0.0], [*far, 1.3], [*start, 1.3]])
    assert bend.free_poses(poses[:2]) == 2
    assert bend.free_poses(poses[::-1]) == 0  # across the lane
    count = bend.free_poses(poses)
    assert kernels.poses_free_count.py_func(bend.grid, bend.shape, poses) == count < 4


def test_the_length_along_which_a_body_heads(bend):
    lane = np.array([point(bend, 12.5, 14.5), point(bend, 22.5, 14.5), point(bend, 32.5, 14.5)])
    assert bend.free_length(lane) == pytest.approx(2.0)
    assert bend.free_length(lane[::-1]) == pytest.approx(2.0)  # nose or tail first
    across = np.vstack((lane[:2], point(bend, 22.5, 16.5)))
    assert bend.free_length(across) == pytest.approx(1.0)  # it cannot turn there
    python = kernels.headed_free_length.py_func(bend.grid, bend.shape, across)
    assert python == bend.free_length(across)


def test_the_nearest_pose(bend):
    wall = point(bend, 15.5, 12.0)
    along, across = np.zeros(1), np.full(1, 0.5 * math.pi)
    found = bend.nearest_pose(wall, 0.5, along)
    assert bend.pose_free(found[:3], found[3])
    assert found[0] == pytest.approx(wall[0])
    assert bend.nearest_pose(wall, 0.5, across) is None
    arguments = bend.grid, bend.shape, (*wall.tolist(), 0.0), 5.0, along
    python = kernels.nearest_pose.py_func(*arguments)
    assert python == kernels.nearest_pose(*arguments)
