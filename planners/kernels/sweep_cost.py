"""Cost of a sweep: length, nearness to obstacles, turns, and motion off the heading."""

from __future__ import annotations

import math

import numpy as np

from wayproof.kernel_compiler import allocating, kernel
from wayproof.planners.kernels.angles import cosine_sine, wrap
from wayproof.planners.kernels.grid import Discs, Floats, Grid, Pose
from wayproof.planners.kernels.polyline import distance
from wayproof.planners.kernels.shortcut import LEAST_GAIN
from wayproof.planners.kernels.sweep import (
    pose_between,
    pose_row,
    step_cost,
    sweep_steps,
    turns_freely,
)

TURN_COST = 0.1
"""Cost of a turn against length, m/rad: a quadruped that turns at 1 rad/s loses 0.1 s of a walk at
1 m/s for each radian that it turns while it walks."""

SPIN_COST = 0.2
"""Cost of each turn on the spot beside its angle, m: at a corner of the path speed is lost."""

LEAST_SPIN = 1e-3
"""Smallest turn on the spot that counts as one, rad."""

SIDEWAYS = 1.0
"""Extra cost of motion sideways, of length: sideways costs twice, backwards thrice."""


@kernel
def sweep_cost(grid: Grid, discs: Discs, weight: float, a: Pose, b: Pose) -> float:
    """Return the cost of a sweep, m; infinite if it is not free.

    Length costs 1 + weight * (mean cost of the discs' cells) + `SIDEWAYS` * (1 - cosine of the
    angle between motion and heading), as sensors look ahead. A turn costs `TURN_COST` a radian, and
    a turn on the spot `SPIN_COST` more.
    """
    x, y = b[0] - a[0], b[1] - a[1]
    level = math.sqrt(x * x + y * y)
    count = sweep_steps(a, b)
    share = distance(a[:3], b[:3]) / count
    cost = TURN_COST * abs(wrap(b[3] - a[3])) + spin_cost(a, b)
    if turns_freely(grid, discs, a, b):
        return cost  # nearness counts by length, which is 0
    for n in range(count):
        before, after = pose_between(a, b, n / count), pose_between(a, b, (n + 1) / count)
        free, near, _ = step_cost(grid, discs, before, after)
        if not free:
            return math.inf
        off_heading = 0.0
        if level > 0.0:
            cosine, sine = cosine_sine(0.5 * (before[3] + after[3]))
            off_heading = SIDEWAYS * max(1.0 - (x * cosine + y * sine) / level, 0.0)
        cost += share * (1.0 + weight * near + off_heading)
    return cost


@kernel
def spin_cost(a: Pose, b: Pose) -> float:
    """Return the cost of a turn on the spot beside that of its angle, m; 0 of any other sweep."""
    if a[0] != b[0] or a[1] != b[1] or a[2] != b[2]:
        return 0.0
    return SPIN_COST if abs(wrap(b[3] - a[3])) > LEAST_SPIN else 0.0


@kernel
def least_sweep_cost(a: Pose, b: Pose) -> float:
    """Return a lower bound of the cost of a sweep, without that of a turn on the spot, m."""
    return distance(a[:3], b[:3]) + TURN_COST * abs(wrap(b[3] - a[3]))


@allocating
def sweep_costs(grid: Grid, discs: Discs, weight: float, poses: Floats) -> Floats:
    """Return the cost of each edge between poses, m, shape (n - 1,)."""
    costs = np.empty(len(poses) - 1)
    for n in range(len(costs)):
        costs[n] = sweep_cost(grid, discs, weight, pose_row(poses, n), pose_row(poses, n + 1))
    return costs


@kernel
def poses_cost(grid: Grid, discs: Discs, weight: float, poses: Floats) -> float:
    """Return the cost of the way through poses (n, 4), m; infinite if it is not free."""
    if not step_cost(grid, discs, pose_row(poses, 0), pose_row(poses, 0))[0]:
        return math.inf
    cost = 0.0
    for n in range(len(poses) - 1):
        cost += sweep_cost(grid, discs, weight, pose_row(poses, n), pose_row(poses, n + 1))
    return cost


@allocating
def prune_poses(grid: Grid, discs: Discs, weight: float, poses: Floats) -> Floats:
    """Leave out each pose without which the way through the others costs no more."""
    kept = poses.copy()
    count = 1
    for n in range(1, len(poses) - 1):
        before, here, after = pose_row(kept, count - 1), pose_row(poses, n), pose_row(poses, n + 1)
        through = sweep_cost(grid, discs, weight, before, here)
        through += sweep_cost(grid, discs, weight, here, after)
        if sweep_cost(grid, discs, weight, before, after) > through + LEAST_GAIN:
            kept[count] = poses[n]
            count += 1
    kept[count] = poses[-1]
    return kept[: count + 1].copy()
