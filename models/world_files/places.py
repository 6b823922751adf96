"""Free places of an imported scene: where a robot can stand, numbered, for a choice of ends."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.world_files.free_space import (
    END_BAND,
    MAX_WALK_SLOPE,
    Grid,
    slope_of,
    survey,
)
from wayproof.models.world_files.options import Found, ImportOptions

MOST_PLACES = 24
"""Number of places."""

LEAST_APART = 1.0
"""Distance between places, m."""

SPARE = 0.1
"""Clearance beyond the robot's radius, m."""

REACH = 2.0
"""Distance from obstacles beyond which places are equally good, m."""


class Place(NamedTuple):
    """A place on the floor.

    Attributes:
        point: m.
        clear: Distance to the nearest obstacle or edge, m; at most `REACH`.
        region: Number of the connected free region that it lies in; 1 is the largest.
    """

    point: Vector3
    clear: float
    region: int


class FreeSpace(NamedTuple):
    """Free space of a scene, as a grid seen from above.

    Attributes:
        low: (2,) corner of the grid, m.
        cell: Side of a cell, m.
        gaps: (nx, ny) distance to what stands in the robot's height, or to an edge, m.
        free: (nx, ny) whether the robot's centre can be there.
        places: Numbered from 1 in this order.
    """

    low: NDArray[np.float64]
    cell: float
    gaps: NDArray[np.float64]
    free: NDArray[np.bool_]
    places: list[Place]


def free_space(found: Found, low: Vector3, high: Vector3, options: ImportOptions) -> FreeSpace:
    """Find places for a robot, the largest connected region first, far from one another.

    Args:
        found: Scene with its floor at 0, or terrain.
        low: Lower corner of the operating area, m.
        high: Upper corner, m.
        options: The robot's radius.
    """
    from scipy import ndimage

    grid, heights, gaps = survey(found, low, high, END_BAND, REACH)
    free = (gaps > options.robot_radius + SPARE) & (slope_of(grid, heights) <= MAX_WALK_SLOPE)
    labels, count = ndimage.label(free, np.ones((3, 3)))
    sizes = np.bincount(labels.ravel(), minlength=count + 1)
    sizes[0] = 0
    places: list[Place] = []
    for rank, label in enumerate(np.argsort(-sizes, kind="stable")[:count], 1):
        left = MOST_PLACES - len(places)
        most = min(left, 2) if rank > 1 else MOST_PLACES * 2 // 3 if count > 1 else left
        region = labels == label
        for cell in _spread(region, np.where(region, gaps, 0.0), grid, most):
            ((x, y),) = grid.centres(*(np.array([n]) for n in cell)).round(3).tolist()
            point = (x, y, round(float(heights[cell]), 4))
            places.append(Place(point, float(gaps[cell]), rank))
        if len(places) >= MOST_PLACES:
            break
    return FreeSpace(grid.low, grid.cell, gaps, free, places)


def _spread(
    region: NDArray[np.bool_], gaps: NDArray[np.float64], grid: Grid, most: int
) -> list[tuple[int, int]]:
    """Return cells of a region, wide ones first, each far from those before."""
    worth = gaps.copy()
    chosen: list[tuple[int, int]] = []
    apart = np.full(region.shape, np.inf)
    i, j = np.indices(region.shape)
    while len(chosen) < most:
        score = np.where(region & (apart >= LEAST_APART), np.minimum(apart, 1e3) + worth, -1.0)
        best = int(np.argmax(score))
        cell = (best // region.shape[1], best % region.shape[1])
        if score[cell] < 0.0:
            break
        chosen.append(cell)
        away = np.hypot(i - cell[0], j - cell[1]) * grid.cell
        apart = np.minimum(apart, away)
    return chosen
