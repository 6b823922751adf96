import itertools
import math

import numpy as np
import pytest

from tests.planners.worlds import long_space, point
from wayproof.planners import (
    FreeSpace,
    PlannerConfig,
    plan,
)
from wayproof.planners.astar.se2 import se2_path


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
