"""The cell at which a free length ends: the first forbidden one that a body's centres touch.

The cells are those of `segment.walk_anywhere`, in the same order and by the same integers.
"""

from __future__ import annotations

import math

from wayproof.maps._jit import kernel
from wayproof.planners.kernels.angles import cosine_sine, yaw_of_direction
from wayproof.planners.kernels.grid import (
    SUBCELL_BITS,
    SUBCELLS,
    Discs,
    Floats,
    Grid,
    Point,
    Pose,
    squared_distance,
    to_subcells,
)
from wayproof.planners.kernels.polyline import row
from wayproof.planners.kernels.segment import axis_steps
from wayproof.planners.kernels.sweep import pose_between, pose_row, sweep_free, sweep_steps

Cell = tuple[int, int, int]
Found = tuple[bool, Cell]


@kernel
def first_forbidden(grid: Grid, threshold: int, a: Point, b: Point) -> Found:
    """Return whether a segment touches a cell whose squared distance is <= threshold, and which."""
    near_a, start = to_subcells(grid, a)
    near_b, end = to_subcells(grid, b)
    i, j, k = start[0] >> SUBCELL_BITS, start[1] >> SUBCELL_BITS, start[2] >> SUBCELL_BITS
    if not (near_a and near_b) or squared_distance(grid, i, j, k) <= threshold:
        return True, (i, j, k)
    faces_x, step_x, next_x, span_x = axis_steps(start[0], end[0])
    faces_y, step_y, next_y, span_y = axis_steps(start[1], end[1])
    faces_z, step_z, next_z, span_z = axis_steps(start[2], end[2])
    while faces_x + faces_y + faces_z > 0:
        first, span = 1, 0
        if faces_x > 0:
            first, span = next_x, span_x
        if faces_y > 0 and next_y * span < first * span_y:
            first, span = next_y, span_y
        if faces_z > 0 and next_z * span < first * span_z:
            first, span = next_z, span_z
        cross_x = faces_x > 0 and next_x * span == first * span_x
        cross_y = faces_y > 0 and next_y * span == first * span_y
        cross_z = faces_z > 0 and next_z * span == first * span_z
        di, dj, dk = cross_x * step_x, cross_y * step_y, cross_z * step_z
        for corner in range(7, 0, -1):  # the next cell, then those beside an edge that is crossed
            along_i, along_j, along_k = corner & 1, (corner >> 1) & 1, corner >> 2
            u, v, w = i + along_i * di, j + along_j * dj, k + along_k * dk
            if squared_distance(grid, u, v, w) <= threshold:
                return True, (u, v, w)
        i, j, k = i + di, j + dj, k + dk
        faces_x, next_x = faces_x - cross_x, next_x + cross_x * SUBCELLS
        faces_y, next_y = faces_y - cross_y, next_y + cross_y * SUBCELLS
        faces_z, next_z = faces_z - cross_z, next_z + cross_z * SUBCELLS
    return False, (i, j, k)


@kernel
def on_path(grid: Grid, threshold: int, path: Floats) -> Found:
    """Return whether a path (n, 3) touches a forbidden cell, and the first."""
    found, cell = first_forbidden(grid, threshold, row(path, 0), row(path, 0))
    for n in range(len(path) - 1):
        if found:
            break
        found, cell = first_forbidden(grid, threshold, row(path, n), row(path, n + 1))
    return found, cell


@kernel
def on_sweep(grid: Grid, discs: Discs, a: Pose, b: Pose) -> Found:
    """Return whether a disc of a body swept between two poses is in a forbidden cell, and which."""
    count = sweep_steps(a, b)
    found, cell = False, (0, 0, 0)
    for n in range(count):
        before, after = pose_between(a, b, n / count), pose_between(a, b, (n + 1) / count)
        cosine_a, sine_a = cosine_sine(before[3])
        cosine_b, sine_b = cosine_sine(after[3])
        for one in range(len(discs.offsets)):
            offset = discs.offsets[one]
            start = before[0] + offset * cosine_a, before[1] + offset * sine_a, before[2]
            end = after[0] + offset * cosine_b, after[1] + offset * sine_b, after[2]
            found, cell = first_forbidden(grid, discs.thresholds[one], start, end)
            if found:
                return found, cell
    return found, cell


@kernel
def on_poses(grid: Grid, discs: Discs, poses: Floats) -> tuple[int, Cell]:
    """Return the first of poses (n, 4) that a body cannot get to, -1 if none, and the cell."""
    found, cell = on_sweep(grid, discs, pose_row(poses, 0), pose_row(poses, 0))
    if found:
        return 0, cell
    for n in range(1, len(poses)):
        found, cell = on_sweep(grid, discs, pose_row(poses, n - 1), pose_row(poses, n))
        if found:
            return n, cell
    return -1, cell


@kernel
def on_headed_path(grid: Grid, discs: Discs, path: Floats) -> Found:
    """Return whether a body that heads along a path (n, 3) is stopped, and its cell, nose first.

    It turns and chooses as `headed.headed_free_length` has it.
    """
    heading, begun, cell = 0.0, False, (0, 0, 0)
    for n in range(len(path) - 1):
        a, b = row(path, n), row(path, n + 1)
        if a[0] == b[0] and a[1] == b[1]:
            continue
        ahead = yaw_of_direction(b[0] - a[0], b[1] - a[1])
        here, chosen = (a[0], a[1], a[2], heading), False
        for tail_first in range(2):
            facing = ahead + tail_first * math.pi
            turned = (a[0], a[1], a[2], facing)
            if not chosen and (not begun or sweep_free(grid, discs, here, turned)):
                chosen = sweep_free(grid, discs, turned, (b[0], b[1], b[2], facing))
                if chosen:
                    heading, begun = facing, True
        if not chosen:
            nose = (a[0], a[1], a[2], ahead)
            found, cell = on_sweep(grid, discs, here if begun else nose, nose)
            if not found:
                found, cell = on_sweep(grid, discs, nose, (b[0], b[1], b[2], ahead))
            return found, cell
    return False, cell
