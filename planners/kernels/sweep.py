"""A body of discs swept from pose to pose: whether it is free, and how far.

Position and heading change evenly, the heading the shorter way round.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import allocating, kernel
from wayproof.planners.kernels.angles import cosine_sine, wrap
from wayproof.planners.kernels.free_box import body_box_free
from wayproof.planners.kernels.grid import (
    SUBCELL_BITS,
    Cell,
    Discs,
    Floats,
    Grid,
    Pose,
    to_subcells,
)
from wayproof.planners.kernels.polyline import distance
from wayproof.planners.kernels.segment import walk_between

TURN_STEP = 0.05
"""Largest turn in a step of a sweep, rad: a disc 1 m from the reference point then bows out by less
than 0.4 mm from the straight line that is checked, 1 - cos(0.05 / 2)."""

LONGEST_BOX = 1.0
"""Longest edge that is first checked by a box about it, m."""


@kernel
def pose_between(a: Pose, b: Pose, share: float) -> Pose:
    """Return the pose at a share of the way from `a` to `b`, turning the shorter way round."""
    return (
        a[0] + share * (b[0] - a[0]),
        a[1] + share * (b[1] - a[1]),
        a[2] + share * (b[2] - a[2]),
        a[3] + share * wrap(b[3] - a[3]),
    )


@kernel
def pose_row(poses: Floats, n: int) -> Pose:
    """Return one pose of an array (n, 4), as a tuple."""
    return poses[n, 0], poses[n, 1], poses[n, 2], poses[n, 3]


@kernel
def sweep_steps(a: Pose, b: Pose) -> int:
    """Return the number of steps of a sweep; in each the body turns by `TURN_STEP` at most."""
    return max(math.ceil(abs(wrap(b[3] - a[3])) / TURN_STEP), 1)


@kernel
def step_cost(grid: Grid, discs: Discs, a: Pose, b: Pose) -> tuple[bool, float, Cell]:
    """Return whether a body is free over a small step of straight discs, and their mean cost.

    And the cell in which a disc's centre ends, that of the first one that is not free.
    """
    cosine_a, sine_a = cosine_sine(a[3])
    cosine_b, sine_b = cosine_sine(b[3])
    cost, cell = 0.0, (0, 0, 0)
    for n in range(len(discs.offsets)):
        offset, threshold = discs.offsets[n], discs.thresholds[n]
        start = (a[0] + offset * cosine_a, a[1] + offset * sine_a, a[2])
        end = (b[0] + offset * cosine_b, b[1] + offset * sine_b, b[2])
        _, least, inside, cell = walk_between(grid, threshold, start, end)
        if least <= threshold:
            return False, math.inf, cell
        cost += inside
    return True, cost / len(discs.offsets), cell


@kernel
def turn_boxed(grid: Grid, discs: Discs, a: Pose, b: Pose) -> bool:
    """Return whether a short sweep with a turn is free by a box about it alone."""
    if sweep_steps(a, b) == 1 or distance(a[:3], b[:3]) > LONGEST_BOX:
        return False
    low = min(a[0], b[0]), min(a[1], b[1]), min(a[2], b[2])
    high = max(a[0], b[0]), max(a[1], b[1]), max(a[2], b[2])
    return body_box_free(grid, discs, low, high)


@kernel
def sweep_free(grid: Grid, discs: Discs, a: Pose, b: Pose) -> bool:
    """Return whether a body is free all the way between two poses; the end is checked first."""
    if turn_boxed(grid, discs, a, b):
        return True
    return step_cost(grid, discs, b, b)[0] and walk_sweep(grid, discs, a, b, 0.0)[1]


@kernel
def walk_sweep(
    grid: Grid, discs: Discs, a: Pose, b: Pose, length: float
) -> tuple[float, bool, Cell]:
    """Sweep a body between two poses up to the first step that is not free.

    Returns:
        A length, m, and that of the way before this step; whether there is none; and the cell that
        a disc meets there.
    """
    count, boxed, cell = sweep_steps(a, b), turn_boxed(grid, discs, a, b), (0, 0, 0)
    for n in range(count):
        before, after = pose_between(a, b, n / count), pose_between(a, b, (n + 1) / count)
        if not boxed:
            free, _, cell = step_cost(grid, discs, before, after)
            if not free:
                return length, False, cell
        length += distance(before[:3], after[:3])
    return length, True, cell


@kernel
def turns_freely(grid: Grid, discs: Discs, a: Pose, b: Pose) -> bool:
    """Return whether a sweep is a turn on the spot, free by its box alone."""
    if a[0] != b[0] or a[1] != b[1] or a[2] != b[2]:
        return False
    return body_box_free(grid, discs, a[:3], a[:3])


@kernel
def poses_free(grid: Grid, discs: Discs, poses: Floats) -> bool:
    """Return whether a body is free all the way through poses (n, 4)."""
    for n in range(len(poses) - 1):
        if not sweep_free(grid, discs, pose_row(poses, n), pose_row(poses, n + 1)):
            return False
    return True


@kernel
def walk_poses(grid: Grid, discs: Discs, poses: Floats) -> tuple[float, int, Cell]:
    """Sweep a body through poses (n, 4) up to the first step that is not free.

    Returns:
        Length before that step, m; the pose that it leads to, n without one; and the cell that a
        disc meets there.
    """
    length, (free, _, cell) = 0.0, step_cost(grid, discs, pose_row(poses, 0), pose_row(poses, 0))
    if not free:
        return length, 0, cell
    for n in range(1, len(poses)):
        before, after = pose_row(poses, n - 1), pose_row(poses, n)
        length, free, cell = walk_sweep(grid, discs, before, after, length)
        if not free:
            return length, n, cell
    return length, len(poses), cell


@allocating
def free_headings(
    grid: Grid, discs: Discs, start: Pose, places: Floats, headings: Floats
) -> tuple[int, NDArray[np.bool_]]:
    """Find the first place that a sweep reaches, and the headings at which it may end there.

    Args:
        grid: The distance field.
        discs: Discs of the body.
        start: Pose where the sweeps begin.
        places: Ends of the sweeps, shape (n, 2), m.
        headings: Shape (m,), rad.

    Returns:
        Index of the place, and whether each heading is free there nose first and tail first, shape
        (m, 2). Tail first counts only where the body turns by a quarter at most.
    """
    free = np.zeros((len(headings), 2), np.bool_)
    found = False
    for n in range(len(places)):
        for m in range(len(headings)):
            for gear in range(2):
                there = wrap(headings[m] + gear * math.pi)
                if gear == 1 and abs(wrap(there - start[3])) > 0.5 * math.pi + 1e-9:
                    continue  # nose first the turn is no longer
                pose = (places[n, 0], places[n, 1], start[2], there)
                free[m, gear] = sweep_free(grid, discs, start, pose)
                found |= free[m, gear]
        if found:
            return n, free
    return 0, free


@kernel
def nearest_pose(
    grid: Grid, discs: Discs, pose: Pose, radius: float, headings: Floats
) -> tuple[bool, Pose]:
    """Find the free pose at a cell's centre nearest to a place, at most `radius` cells away.

    Among poses equally near the lowest index wins, and among headings the first.

    Returns:
        Whether there is one, and the pose.
    """
    near, at = to_subcells(grid, pose[:3])
    if not near:
        return False, pose
    i, j = at[0] >> SUBCELL_BITS, at[1] >> SUBCELL_BITS
    reach = math.ceil(radius) + 1
    found, best, nearest = False, pose, radius * grid.resolution
    for ci in range(max(i - reach, 0), min(i + reach + 1, grid.field.shape[0])):
        for cj in range(max(j - reach, 0), min(j + reach + 1, grid.field.shape[1])):
            x = grid.origin[0] + (ci + 0.5) * grid.resolution
            y = grid.origin[1] + (cj + 0.5) * grid.resolution
            away = distance((x, y, 0.0), (pose[0], pose[1], 0.0))
            if away > nearest or (found and away == nearest):
                continue
            for heading in headings:
                there = (x, y, pose[2], heading)
                if step_cost(grid, discs, there, there)[0]:
                    found, best, nearest = True, there, away
                    break
    return found, best
