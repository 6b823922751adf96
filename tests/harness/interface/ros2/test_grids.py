"""The referee's map and costmap as occupancy grids."""

import math

import numpy as np
import pytest

from tests.maps.costmap.test_costmap import BODY, FLOOR, HIGH, LOW, StateArray
from wayproof.harness.interface.ros2.grids import costmap_grid, map_grid
from wayproof.harness.interface.ros2.messages import Time
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, Costmap, CostmapConfig

RADIUS = 0.2


@pytest.fixture
def costmap():
    """A floor of 30 x 20 cells, free above, with a post at (10, 5) and the right part unknown."""
    states = np.full((30, 20, 15), UNKNOWN, np.uint8)
    states[:, :, FLOOR] = OCCUPIED
    states[:, :, FLOOR + 1 :] = FREE
    states[10, 5, BODY] = OCCUPIED
    states[25:] = UNKNOWN
    config = CostmapConfig(localization_margin=0.0)
    made = Costmap(config, StateArray(states), LOW, HIGH, "ground", RADIUS, 0.4, 0.15)
    assert made.state[10, 5, 0] == OCCUPIED
    return made


def cells(grid):
    return grid.data.reshape(grid.info.height, grid.info.width)


def test_the_map_has_three_values_and_its_rows_run_along_x(costmap):
    grid = map_grid(costmap, "map", Time(3, 0))
    assert (grid.info.width, grid.info.height) == costmap.shape[:2]
    assert grid.header.frame_id == "map"
    corner = grid.info.origin.position
    assert (corner.x, corner.y) == pytest.approx(tuple(costmap.origin[:2]))
    assert cells(grid)[5, 10] == 100
    assert cells(grid)[5, 3] == 0
    assert (cells(grid)[:, 25:30] == -1).all()
    assert set(np.unique(grid.data)) == {-1, 0, 100}


def test_costs_are_scaled_as_nav2_publishes_them(costmap):
    grid = cells(costmap_grid(costmap, "map", Time(3, 0)))
    assert grid[5, 10] == 100
    assert grid[5, 11] == grid[5, 9] == 99  # the body collides there
    assert (grid[:, 25:30] == -1).all()
    away = grid[12, 10:20]
    assert ((away >= 0) & (away < 99)).all()
    cost = costmap.cost_table[costmap.obstacle_clearance[10, 9, 0]]
    assert math.isfinite(cost)
    assert grid[9, 10] == math.floor(1 + 97 * (cost - 1) / 251)
