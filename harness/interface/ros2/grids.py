"""Occupancy grids: the referee's map and costmap out, a stack's own costmap in."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.interface.ros2.messages import (
    LEVEL,
    Header,
    MapMetaData,
    OccupancyGrid,
    Point,
    Pose,
    Time,
)
from wayproof.maps import FREE, OCCUPIED, Costmap

INSCRIBED, LETHAL, UNKNOWN = 99, 100, -1
"""Values of a costmap as a grid: the body collides, the cell is occupied, nothing is known (Nav2,
`costmap_2d_publisher.cpp`)."""

HIGHEST_COST = 98
"""Value of Nav2's cost 252."""


def map_grid(costmap: Costmap, frame: str, stamp: Time) -> OccupancyGrid:
    """Return the three states of a plane: free 0, occupied 100, unknown -1."""
    state = costmap.state[:, :, 0]
    cells = np.where(state == OCCUPIED, LETHAL, np.where(state == FREE, 0, UNKNOWN))
    return _grid(costmap, cells, frame, stamp)


def costmap_grid(costmap: Costmap, frame: str, stamp: Time) -> OccupancyGrid:
    """Return costs of a plane, scaled as Nav2 publishes them; unknown stays unknown."""
    state, distances = costmap.state[:, :, 0], costmap.obstacle_clearance[:, :, 0]
    costs = costmap.cost_table[distances]
    scaled = np.where(costs > 0.0, 1.0 + (HIGHEST_COST - 1) * (costs - 1.0) / 251.0, 0.0)
    cells = np.where(np.isinf(costs), INSCRIBED, np.clip(np.floor(scaled), 0, HIGHEST_COST))
    cells = np.where(state == OCCUPIED, LETHAL, np.where(state == FREE, cells, UNKNOWN))
    return _grid(costmap, cells, frame, stamp)


def _grid(costmap: Costmap, cells: NDArray[np.generic], frame: str, stamp: Time) -> OccupancyGrid:
    width, height = cells.shape
    x, y = (float(value) for value in costmap.origin[:2])
    info = MapMetaData(stamp, costmap.resolution, width, height, Pose(Point(x, y, 0.0), LEVEL))
    return OccupancyGrid(Header(stamp, frame), info, cells.T.astype(np.int8).ravel())
