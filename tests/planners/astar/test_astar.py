"""Searches of A*: on the grid, with headings, and their tables."""

import itertools
import math

import numpy as np
import pytest

from tests.planners.lattices import cells_of
from tests.planners.worlds import long_space, point
from wayproof.planners import (
    Body,
    FreeSpace,
    PlannerConfig,
    plan,
)
from wayproof.planners.astar.primitives import LENGTHS, STEPS, motion_primitives
from wayproof.planners.astar.se2 import reversible, se2_path


def test_tables_by_hand():
    ways = motion_primitives((0.0,), 0, 1)
    assert ways.lengths.tolist() == [LENGTHS[x * x + y * y] for x, y in STEPS]
    cells = [cells_of(ways.stepped, way) for way in range(16)]
    assert cells[0] == {(0, 0), (1, 0)}
    assert cells[2] == {(0, 0), (1, 0), (0, 1), (1, 1)}  # through the corner of four
    assert cells[1] == {(0, 0), (1, 0), (1, 1), (2, 1)}
    assert ways.turned.counts.tolist() == [[1]] * 16  # the centre of the body stays


def test_a_gap_that_the_coarse_lattice_lacks_is_found_on_the_grid():
    blocked = np.zeros((60, 60, 1), dtype=bool)
    blocked[30] = True
    field = np.where(blocked, 0, 100).astype(np.uint16)
    field[30, 32] = 100  # one cell wide, not in the middle of any block of two
    space = FreeSpace(field, np.zeros(3), 0.05, 4, np.zeros(101))
    start, goal = np.array([0.5, 0.5, 0.025]), np.array([2.5, 0.5, 0.025])
    found = plan(space, start, goal, PlannerConfig(name="astar"), seed=1)
    assert found.label == "none"
    assert all(space.edge_free(a, b) for a, b in itertools.pairwise(found.waypoints))
    crossing = np.abs(found.waypoints[:, 0] - 1.525).argmin()
    assert found.waypoints[crossing, 1] == pytest.approx(1.625, abs=0.1)


def slanted_lane() -> FreeSpace:
    """A dead end at 11 degrees, too narrow for the headings that a search has."""
    x, y = np.meshgrid(np.arange(120) + 0.5, np.arange(60) + 0.5, indexing="ij")
    off = np.abs((y - 20.0) * math.cos(0.19) - (x - 5.0) * math.sin(0.19))
    return long_space(((off > 3.1) & (x < 45))[:, :, None])


def test_where_no_heading_of_the_search_fits_others_are_sampled():
    space = slanted_lane()
    start, goal = point(space, 16.0, 20.0 + 11.0 * math.tan(0.19)), point(space, 100.5, 30.5)
    assert space.pose_free(start, 0.19)
    assert se2_path(space, (*start, 0.19), (*goal, 0.0), 10**6) is None
    found = plan(space, start, goal, PlannerConfig(), seed=1, heading=0.19)
    assert found.label == "none"
    assert space.free_poses(np.column_stack((found.waypoints, found.headings))) == len(
        found.waypoints
    )


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
