"""A body of discs swept from pose to pose: whether it is free, and how far.

Position and heading change evenly, the heading the shorter way round.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayproof.maps._jit import allocating, kernel
from wayproof.planners.kernels.angles import cosine_sine, wrap
from wayproof.planners.kernels.free_box import body_box_free
from wayproof.planners.kernels.grid import SUBCELL_BITS, Discs, Floats, Grid, Pose, to_subcells
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
def step_cost(grid: Grid, discs: Discs, a: Pose, b: Pose) -> tuple[bool, float]:
    """Return whether a body is free over a small step of straight discs, and their mean cost."""
    cosine_a, sine_a = cosine_sine(a[3])
    cosine_b, sine_b = cosine_sine(b[3])
    cost = 0.0
    for n in range(len(discs.offsets)):
        offset, threshold = discs.offsets[n], discs.thresholds[n]
        start = (a[0] + offset * cosine_a, a[1] + offset * sine_a, a[2])
        end = (b[0] + offset * cosine_b, b[1] + offset * sine_b, b[2])
        _, least, inside = walk_between(grid, threshold, start, end)
        if least <= threshold:
            return False, math.inf
        cost += inside
    return True, cost / len(discs.offsets)


@kernel
def sweep_free(grid: Grid, discs: Discs, a: Pose, b: Pose) -> bool:
    """Return whether a body is free all the way between two poses; the end is checked first."""
    count = sweep_steps(a, b)
    if count > 1 and distance(a[:3], b[:3]) <= LONGEST_BOX:
        low = min(a[0], b[0]), min(a[1], b[1]), min(a[2], b[2])
        high = max(a[0], b[0]), max(a[1], b[1]), max(a[2], b[2])
        if body_box_free(grid, discs, low, high):
            return True
    if not step_cost(grid, discs, b, b)[0]:
        return False
    for n in range(count):
        before, after = pose_between(a, b, n / count), pose_between(a, b, (n + 1) / count)
        if not step_cost(grid, discs, before, after)[0]:
            return False
    return True


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
def poses_free_length(grid: Grid, discs: Discs, poses: Floats) -> float:
    """Return the length of the way through poses (n, 4) before the first blocked step, m."""
    length = 0.0
    for edge in range(len(poses) - 1):
        a, b = pose_row(poses, edge), pose_row(poses, edge + 1)
        count = sweep_steps(a, b)
        for n in range(count):
            before, after = pose_between(a, b, n / count), pose_between(a, b, (n + 1) / count)
            if not step_cost(grid, discs, before, after)[0]:
                return length
            length += distance(before[:3], after[:3])
    return length


@kernel
def poses_free_count(grid: Grid, discs: Discs, poses: Floats) -> int:
    """Return the number of poses (n, 4) that a body reaches one after the other."""
    if not step_cost(grid, discs, pose_row(poses, 0), pose_row(poses, 0))[0]:
        return 0
    for n in range(len(poses) - 1):
        if not sweep_free(grid, discs, pose_row(poses, n), pose_row(poses, n + 1)):
            return n + 1
    return len(poses)


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
