"""A body of discs that heads along a path and turns on the spot at its points."""

from __future__ import annotations

import math

from wayproof.kernel_compiler import kernel
from wayproof.planners.kernels.angles import yaw_of_direction
from wayproof.planners.kernels.free_box import any_heading_free
from wayproof.planners.kernels.grid import Cell, Discs, Floats, Grid
from wayproof.planners.kernels.polyline import LEAST_EDGE, distance, path_length, row
from wayproof.planners.kernels.segment import walk_path
from wayproof.planners.kernels.sweep import LONGEST_BOX, sweep_free, walk_sweep

BOXES = (16, 4, 1)
"""Numbers of edges that are checked together, the first that are free and within `LONGEST_BOX`."""


@kernel
def walk_headed(grid: Grid, discs: Discs, path: Floats) -> tuple[float, bool, Cell]:
    """Walk a path (n, 3) up to the first edge that a body cannot head along.

    It turns on the spot at each point: nose first, or where that is not free, tail first. Edges in
    a free box are not checked one by one.

    Returns:
        Length before that edge, m, whether there is one, and the cell that stops the body nose
        first.
    """
    length, heading, begun, known = 0.0, 0.0, False, 0
    for n in range(len(path) - 1):
        a, b = row(path, n), row(path, n + 1)
        if a[0] == b[0] and a[1] == b[1]:
            continue
        ahead = yaw_of_direction(b[0] - a[0], b[1] - a[1])
        if n >= known:
            known = free_up_to(grid, discs, path, n)
        if n < known:
            heading, begun = ahead, True
            length += distance(a, b)
            continue
        # Nose first if the turn and the edge are free, else tail first.
        here = (a[0], a[1], a[2], heading)
        chosen = False
        for tail_first in range(2):
            facing = ahead + tail_first * math.pi
            turned = (a[0], a[1], a[2], facing)
            if not chosen and (not begun or sweep_free(grid, discs, here, turned)):
                chosen = sweep_free(grid, discs, turned, (b[0], b[1], b[2], facing))
                if chosen:
                    heading, begun = facing, True
        if not chosen:
            nose = (a[0], a[1], a[2], ahead)
            _, free, cell = walk_sweep(grid, discs, here if begun else nose, nose, 0.0)
            if free:
                _, free, cell = walk_sweep(grid, discs, nose, (b[0], b[1], b[2], ahead), 0.0)
            return length, True, cell
        length += distance(a, b)
    return length, False, (0, 0, 0)


@kernel
def free_up_to(grid: Grid, discs: Discs, path: Floats, first: int) -> int:
    """Return the last point up to which the edges are in one box free at any heading."""
    for edges in BOXES:
        last = min(first + edges, len(path) - 1)
        if distance(row(path, first), row(path, last)) <= LONGEST_BOX and any_heading_free(
            grid, discs, path, first, last
        ):
            return last
    return first


@kernel
def path_free(grid: Grid, discs: Discs, oriented: bool, path: Floats) -> bool:
    """Return whether a path (n, 3) is free, for one disc or for a body that heads along it."""
    if oriented:
        return bool(walk_headed(grid, discs, path)[0] > path_length(path) - LEAST_EDGE)
    return bool(walk_path(grid, discs.thresholds[0], 0.0, path)[1] > discs.thresholds[0])
