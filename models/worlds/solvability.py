"""Solvability: whether a body can get from start to goal in truth, and the shortest way.

The truth is the world's solids, not a map of them: each grid cell knows the distance from its
centre to the nearest solid that stands in the body's height band. What moves is left out.
"""

from __future__ import annotations

from math import ceil, floor

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.kernel_compiler import kernel
from wayproof.models.grids import distances, ways
from wayproof.models.worlds.solids import Band, Solid
from wayproof.models.worlds.world import World

RESOLUTION = 0.05
"""Side of a cell, m."""

REFERENCE_RADIUS = 0.75
"""Radius of a disc that every world lets through up to a difficulty of 0.5, m: a quadruped of 0.45
m, a margin of 0.1 m, and the two cells of 10 cm that a map may round away."""

TIGHTEST_RADIUS = 0.6
"""Radius of a disc that every world lets through at difficulty 1, m: the same body and margin; a
map of 10 cm may close the gap."""

GROUND_BAND = (0.03, 0.5)
"""Height band of the reference quadruped, m: from its step height to its back."""

AIR_BANDS = ((0.8, 1.6), (1.3, 2.2))
"""Altitude bands; the reference drone needs one, m."""

LOWEST_FLIGHT = 0.2
"""Lower end of a height band below which a body needs floor under it, m."""


def is_solvable(world: World, radius: float, band: Band, start: ArrayLike, goal: ArrayLike) -> bool:
    """Return whether an upright cylinder can move from start to goal without touching a solid.

    Args:
        world: Truth.
        radius: Radius of the cylinder, m.
        band: Heights of the cylinder, m: solids that end at or below the lower one are stepped or
            flown over, those that begin at or above the upper one are passed under.
        start: (2,) or (3,) world frame, m; z is ignored.
        goal: (2,) or (3,) world frame, m; z is ignored.
    """
    free = free_cells(world, radius, band)
    labels = label_regions(free)
    start_label = labels[cell_of(world, start)]
    return bool(start_label > 0 and start_label == labels[cell_of(world, goal)])


def shortest_path_length(
    world: World, radius: float, band: Band, start: ArrayLike, goal: ArrayLike
) -> float | None:
    """Return the length of the shortest way in the plane, m, or None when there is none.

    The 8-connected grid path (Dijkstra), pulled taut through free cells: without that a straight
    line at 22.5 degrees would count 8 % too long. Arguments as for `is_solvable`.
    """
    way = shortest_path(world, radius, band, start, goal)
    if way is None:
        return None
    return float(np.sqrt(np.square(np.diff(way, axis=0)).sum(axis=1)).sum())


def shortest_path(
    world: World, radius: float, band: Band, start: ArrayLike, goal: ArrayLike
) -> NDArray[np.float64] | None:  # (n, 2)
    """Return the corners of that way, both ends included, m; None when there is none."""
    free = free_cells(world, radius, band)
    cells = _grid_path(free, cell_of(world, start), cell_of(world, goal))
    if cells is None:
        return None
    centres = np.asarray(world.low[:2]) + (cells + 0.5) * RESOLUTION  # (n, 2)
    points = np.vstack([np.ravel(start)[:2], centres[1:-1], np.ravel(goal)[:2]])
    return np.asarray(points[_taut(free, cells)])


def passage_radius(difficulty: float) -> float:
    """Return radius of the disc that a world lets through, m.

    `REFERENCE_RADIUS` up to a difficulty of 0.5, then less, down to `TIGHTEST_RADIUS`.
    """
    tight = max(2.0 * difficulty - 1.0, 0.0)
    return REFERENCE_RADIUS + tight * (TIGHTEST_RADIUS - REFERENCE_RADIUS)


def free_cells(world: World, radius: float, band: Band) -> NDArray[np.bool_]:  # (nx, ny)
    """Return the cells whose centre is farther than `radius` from every solid in the band.

    Nor is a cell free for a body on the ground that is as near to a hole in the floor.
    """
    extent = np.subtract(world.high[:2], world.low[:2])
    free = np.ones(tuple(np.rint(extent / RESOLUTION).astype(int)), np.bool_)
    if world.floor is not None and band[0] < LOWEST_FLIGHT:
        free &= _far_from_holes(world, free.shape, radius)
    for solid in world.solids:
        if solid.bottom < band[1] and solid.top > band[0]:
            clear_around(free, world, solid, radius, band)
    return free


def clear_around(
    free: NDArray[np.bool_], world: World, solid: Solid, radius: float, band: Band = GROUND_BAND
) -> None:
    """Mark the cells within `radius` of a solid, where it stands in the band, in place."""
    (first_x, last_x), (first_y, last_y) = (
        _cells_between(solid.low[axis] - radius, solid.high[axis] + radius, world, free, axis)
        for axis in (0, 1)
    )
    window = free[first_x:last_x, first_y:last_y]
    i, j = np.nonzero(window)  # where it is not free any more there is nothing to find out
    if not len(i):
        return
    centres = np.empty((len(i), 2))
    centres[:, 0] = world.low[0] + (first_x + i + 0.5) * RESOLUTION
    centres[:, 1] = world.low[1] + (first_y + j + 0.5) * RESOLUTION
    window[i, j] = solid.distance_in_plane(centres, band) > radius


def _cells_between(
    low: float, high: float, world: World, free: NDArray[np.bool_], axis: int
) -> tuple[int, int]:
    """Return first cell and one past the last of an interval, m, along an axis, in the grid."""
    cells = free.shape[axis]
    first = floor((low - world.low[axis]) / RESOLUTION)
    last = ceil((high - world.low[axis]) / RESOLUTION)
    return min(max(first, 0), cells), min(max(last, 0), cells)


def _far_from_holes(
    world: World, shape: tuple[int, ...], radius: float
) -> NDArray[np.bool_]:  # (nx, ny)
    """Return cells farther than `radius` from all that no slab of the floor bears."""
    hole = np.ones(shape, np.bool_)
    for slab in world.floor or ():
        clear_around(hole, world, slab, 0.0)
    if not hole.any():
        return np.ones(shape, np.bool_)
    from scipy import ndimage  # slow to load

    distance = ndimage.distance_transform_edt(~hole, sampling=RESOLUTION)
    return np.asarray(distance > radius + RESOLUTION / 2)  # a hole ends between two centres


def label_regions(free: NDArray[np.bool_]) -> NDArray[np.int32]:  # (nx, ny)
    """Return number the 8-connected regions of free cells from 1; 0 is not free."""
    labels = np.zeros(free.shape, np.int32)
    number_regions(free, labels, np.empty(free.size, np.int64))
    return labels


@kernel
def number_regions(
    free: NDArray[np.bool_],  # (nx, ny)
    labels: NDArray[np.int32],  # (nx, ny) zeros, out
    ahead: NDArray[np.int64],  # (nx ny,) scratch
) -> int:
    """Number the 8-connected regions of free cells in the order of their first; return how many."""
    nx, ny = free.shape
    count = 0
    for first in range(nx * ny):
        if not free[first // ny, first % ny] or labels[first // ny, first % ny]:
            continue
        count += 1
        labels[first // ny, first % ny] = count
        ahead[0], left = first, 1
        while left:
            left -= 1
            x, y = ahead[left] // ny, ahead[left] % ny
            for u in range(max(x - 1, 0), min(x + 2, nx)):
                for v in range(max(y - 1, 0), min(y + 2, ny)):
                    if free[u, v] and labels[u, v] == 0:
                        labels[u, v] = count
                        ahead[left] = u * ny + v
                        left += 1
    return count


def cell_of(world: World, point: ArrayLike) -> tuple[int, int]:
    """Return the index of the cell that holds a point.

    Raises:
        ValueError: The point is outside the world.
    """
    x, y = np.ravel(np.asarray(point, np.float64))[:2]
    if not (world.low[0] <= x < world.high[0] and world.low[1] <= y < world.high[1]):
        raise ValueError(f"point: got ({x}, {y}), expected in {world.low[:2]}..{world.high[:2]}")
    return int((x - world.low[0]) / RESOLUTION), int((y - world.low[1]) / RESOLUTION)


def _grid_path(
    free: NDArray[np.bool_], start: tuple[int, int], goal: tuple[int, int]
) -> NDArray[np.int64] | None:  # (n, 2)
    """Return cells of a shortest 8-connected path, both ends included."""
    if not (free[start] and free[goal]):
        return None
    first = int(np.ravel_multi_index(start, free.shape))
    node = int(np.ravel_multi_index(goal, free.shape))
    previous = ways(free, [first], RESOLUTION, until=node)[1]
    path = [node]
    while node != first:
        node = int(previous[node])
        if node < 0:
            return None
        path.append(node)
    return np.stack(np.unravel_index(path[::-1], free.shape), axis=1)


def _taut(free: NDArray[np.bool_], cells: NDArray[np.int64]) -> list[int]:
    """Return the indices of the path's corners: from each, the farthest cell in sight is next."""
    corners = [0]
    while corners[-1] < len(cells) - 1:
        corners.append(_farthest_in_sight(free, cells, corners[-1]))
    return corners


def warm_up() -> None:
    """Compile the search of ways and their corners, and distances."""
    free = np.ones((3, 3), np.bool_)
    label_regions(free)
    _grid_path(free, (0, 0), (2, 2))
    _taut(free, np.array([[0, 0], [1, 1], [2, 2]]))
    distances(free)


@kernel
def _farthest_in_sight(free: NDArray[np.bool_], cells: NDArray[np.int64], here: int) -> int:
    """Return the last cell of a path that is seen from one of them, at least the next one."""
    x, y = cells[here]
    for ahead in range(len(cells) - 1, here + 1, -1):
        dx, dy = cells[ahead, 0] - x, cells[ahead, 1] - y
        steps = 2 * max(abs(dx), abs(dy))  # two samples a cell
        seen = True
        for n in range(steps + 1):
            fraction = n * (1.0 / steps) if n < steps else 1.0
            seen &= free[int(np.rint(x + fraction * dx)), int(np.rint(y + fraction * dy))]
            if not seen:
                break
        if seen:
            return ahead
    return here + 1
