"""Frontiers, the border of known free space: the next viewpoint where no path to the goal is known.

Yamauchi 1997, "A frontier-based approach for autonomous exploration", with the distance from the
frontier to the goal added to its cost.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.planners.free_space import FreeSpace

Array = NDArray[np.float64]

VISITED_RADIUS = 0.35
"""Distance from a visited viewpoint up to which a frontier counts as visited, m."""


def best_frontier(
    traversable: FreeSpace, optimistic: FreeSpace, position: Array, goal: Array, visited: Array
) -> Array | None:
    """Return the reachable frontier cell of the shortest straight way there and on to the goal.

    A frontier cell is traversable and touches a cell that is not, but would be if unknown cells
    were free.

    Args:
        traversable: Space that the body may enter.
        optimistic: Space that is not known to be blocked.
        position: Position of the body, m, shape (3,).
        goal: m, shape (3,).
        visited: Viewpoints visited before, m, shape (n, 3); rows that are not finite are ignored.

    Returns:
        The cell's centre (3,), or None if there is no frontier left.
    """
    from scipy import ndimage  # a fifth of the time that the program takes to start

    free = traversable.distances > traversable.collision_distance_sq
    unseen = (optimistic.distances > optimistic.collision_distance_sq) & ~free
    areas, _ = ndimage.label(free)
    here = areas[_cell(traversable, position)]
    if here == 0:
        return None
    reachable = areas == here
    cells = np.argwhere(reachable & ndimage.binary_dilation(unseen))
    centres: Array = traversable.origin + (cells + 0.5) * traversable.resolution  # (k, 3)
    for viewpoint in visited[np.isfinite(visited).all(axis=1)]:
        centres = centres[_distances(centres, viewpoint) > VISITED_RADIUS]
    if len(centres) == 0:
        return None
    costs = _distances(centres, position) + _distances(centres, goal)
    best: Array = centres[int(np.argmin(costs))]
    return best


def _cell(space: FreeSpace, point: Array) -> tuple[int, ...]:
    """Return the indices of the cell that holds a point, clipped to the grid."""
    cell = np.floor((point - space.origin) / space.resolution).astype(int)
    return tuple(np.clip(cell, 0, np.array(space.grid.field.shape) - 1).tolist())


def _distances(points: Array, point: Array) -> Array:
    distances: Array = np.sqrt(np.square(points - point).sum(axis=1))
    return distances
