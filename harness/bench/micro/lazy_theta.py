"""Lazy Theta* on the cells of a grid at full resolution: the reference that lengths are held to."""

from __future__ import annotations

import heapq

import numba
import numpy as np
from numpy.typing import NDArray

from wayproof.planners import FreeSpace
from wayproof.planners.kernels import polyline, segment, shortcut
from wayproof.planners.kernels.grid import Grid, Point
from wayproof.planners.problem import shortcut_draws

Array = NDArray[np.float64]
Scratch = tuple[Array, NDArray[np.int32], NDArray[np.uint8]]

REFERENCE_SHORTCUTS = 1000
_compiled = numba.njit(error_model="numpy")  # not cached: of use to the bench alone


def scratch_for(space: FreeSpace) -> Scratch:
    """Return room for the searches of one space, one after the other."""
    cells = space.field.size
    return np.empty(cells), np.empty(cells, np.int32), np.zeros(cells, np.uint8)


def reference_path(
    space: FreeSpace, start: Array, goal: Array, seed: int, scratch: Scratch
) -> Array | None:
    """Search by Lazy Theta* from cell to cell, then shorten: (n, 3) m; None if there is no way."""
    cells = [np.floor((p - space.origin) / space.resolution).astype(int) for p in (start, goal)]
    first, last = (int(np.ravel_multi_index(tuple(cell), space.field.shape)) for cell in cells)
    threshold = space.collision_distance_sq
    scratch[2][:] = 0
    if not _lazy_theta(space.grid, threshold, first, last, *scratch):
        return None
    way = [last]
    while way[-1] != first:
        way.append(int(scratch[1][way[-1]]))
    indices = np.stack(np.unravel_index(way[::-1], space.field.shape), axis=-1)
    inner = space.origin + (indices + 0.5) * space.resolution
    path = np.vstack((start, inner, goal))
    draws = shortcut_draws(REFERENCE_SHORTCUTS, not space.flat, seed)
    shortened: Array = shortcut.shortcut(space.grid, threshold, 0.0, 0.0, path, draws)
    return shortened


@_compiled
def _centre(grid: Grid, cell: int) -> Point:
    """Return the centre of a cell by its flat index."""
    _, ny, nz = grid.field.shape
    x = grid.origin[0] + (cell // (ny * nz) + 0.5) * grid.resolution
    y = grid.origin[1] + ((cell // nz) % ny + 0.5) * grid.resolution
    return x, y, grid.origin[2] + (cell % nz + 0.5) * grid.resolution


@_compiled
def _lazy_theta(
    grid: Grid,
    threshold: int,
    start: int,
    goal: int,
    cost: Array,
    parent: NDArray[np.int32],
    state: NDArray[np.uint8],
) -> bool:
    """Search by Lazy Theta* (Nash, Koenig, Tovey, AAAI 2010, figure 5) on the cells of a grid.

    Args:
        grid: The field.
        threshold: A cell is forbidden at or below it.
        start: Flat index of a free cell.
        goal: Flat index of a free cell.
        cost: (n,) out, m, of the closed cells.
        parent: (n,) out, flat indices.
        state: (n,) 0 for new; 1 is open, 2 closed.
    """
    nx, ny, nz = grid.field.shape
    flat_field = grid.field.reshape(-1)

    target = _centre(grid, goal)
    cost[start], parent[start], state[start] = 0.0, start, 1
    queue = [(polyline.distance(_centre(grid, start), target), start)]
    while len(queue) > 0:
        _, cell = heapq.heappop(queue)
        if state[cell] == 2:
            continue
        here = _centre(grid, cell)
        i, j, k = cell // (ny * nz), (cell // nz) % ny, cell % nz
        around = [
            (u * ny + v) * nz + w
            for u in range(max(i - 1, 0), min(i + 2, nx))
            for v in range(max(j - 1, 0), min(j + 2, ny))
            for w in range(max(k - 1, 0), min(k + 2, nz))
        ]
        if not segment.edge_free(grid, threshold, _centre(grid, parent[cell]), here):
            cost[cell] = np.inf
            for other in around:
                if state[other] == 2 and segment.edge_free(
                    grid, threshold, _centre(grid, other), here
                ):
                    through = cost[other] + polyline.distance(_centre(grid, other), here)
                    if through < cost[cell]:
                        cost[cell], parent[cell] = through, other
            if cost[cell] == np.inf:  # reached past a blocked corner only
                state[cell] = 0
                continue
        state[cell] = 2
        if cell == goal:
            return True
        seen = parent[cell]
        for other in around:
            if state[other] == 2 or flat_field[other] <= threshold:
                continue
            through = cost[seen] + polyline.distance(_centre(grid, seen), _centre(grid, other))
            if state[other] == 0 or through < cost[other]:
                cost[other], parent[other], state[other] = through, seen, 1
                heapq.heappush(
                    queue, (through + polyline.distance(_centre(grid, other), target), other)
                )
    return False
