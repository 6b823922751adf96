"""Shortcuts of a path of poses, for a body with a heading."""

from __future__ import annotations

import numpy as np

from wayproof.kernel_compiler import allocating, kernel
from wayproof.planners.kernels.angles import yaw_of_direction
from wayproof.planners.kernels.grid import Discs, Floats, Grid, Point, Pose
from wayproof.planners.kernels.polyline import between, distance
from wayproof.planners.kernels.shortcut import LEAST_GAIN, total
from wayproof.planners.kernels.sweep import pose_between, pose_row
from wayproof.planners.kernels.sweep_cost import (
    least_sweep_cost,
    prune_poses,
    spin_cost,
    sweep_cost,
    sweep_costs,
)


@allocating
def shortcut_poses(grid: Grid, discs: Discs, weight: float, poses: Floats, draws: Floats) -> Floats:
    """Shorten as `shortcut`, for a body that turns, moves straight ahead, and turns again.

    Args:
        grid: The distance field.
        discs: Discs of the body.
        weight: Weight of the cell cost against length.
        poses: Shape (n, 4), n >= 2, free pose by pose.
        draws: Shape (m, 5): two places along the path in [0, 1) and the offset, m.

    Returns:
        Poses between the same ends, shape (k, 4).
    """
    points = poses.copy()
    costs, arcs = sweep_costs(grid, discs, weight, points), pose_arcs(points)
    fresh = np.empty((8, 4))
    for draw in draws:
        i, u = pose_at(points, arcs, min(draw[0], draw[1]) * arcs[-1])
        j, v = pose_at(points, arcs, max(draw[0], draw[1]) * arcs[-1])
        middle = between(u[:3], v[:3], 0.5)
        apex = (middle[0] + draw[2], middle[1] + draw[3], middle[2] + draw[4])
        old = total(costs[i : j + 1])
        fresh[0] = points[i]
        for bent in (False, True):
            end = write_detour(u, apex, v, bent, fresh)
            fresh[end] = points[j + 1]
            if is_cheaper(grid, discs, weight, fresh[: end + 1], old):
                points = np.concatenate((points[: i + 1], fresh[1:end], points[j + 1 :]))
                inside = sweep_costs(grid, discs, weight, fresh[: end + 1])
                costs = np.concatenate((costs[:i], inside, costs[j + 1 :]))
                arcs = pose_arcs(points)
                break
    return prune_poses(grid, discs, weight, points)


@kernel
def write_detour(u: Pose, apex: Point, v: Pose, bent: bool, fresh: Floats) -> int:
    """Write the poses of a way from `u` to `v`: straight ahead, turning on the spot at each point.

    Args:
        u: First pose.
        apex: Middle point, m.
        v: Last pose.
        bent: Whether the way leads over the apex.
        fresh: Shape (8, 4), out: from row 1 on.

    Returns:
        The row after the last.
    """
    turn = u[:3]
    if bent:
        turn = apex
        there = yaw_of_direction(apex[0] - u[0], apex[1] - u[1])
        put_pose(fresh, 2, u[:3], there)
        put_pose(fresh, 3, apex, there)
    count = 4 if bent else 2
    on = yaw_of_direction(v[0] - turn[0], v[1] - turn[1])
    put_pose(fresh, 1, u[:3], u[3])
    put_pose(fresh, count, turn, on)
    put_pose(fresh, count + 1, v[:3], on)
    put_pose(fresh, count + 2, v[:3], v[3])
    return count + 3


@kernel
def put_pose(poses: Floats, n: int, point: Point, heading: float) -> None:
    """Write one pose of an array."""
    poses[n, 0], poses[n, 1], poses[n, 2], poses[n, 3] = point[0], point[1], point[2], heading


@kernel
def is_cheaper(grid: Grid, discs: Discs, weight: float, poses: Floats, than: float) -> bool:
    """Return whether the way through poses costs less than a bound, m.

    Lower bounds of the edges give way to their costs one by one, until the sum is too high.
    """
    cost, spins = LEAST_GAIN, 0.0
    edges = len(poses) - 1
    for n in range(edges):
        a, b = pose_row(poses, n), pose_row(poses, n + 1)
        cost += least_sweep_cost(a, b)
        spins += spin_cost(a, b)
    # Straight edges first, then the turns on the spot, which take long to check; at last the outer
    # two, which are parts of edges that are free already.
    for kind in range(3):
        for n in range(edges):
            outer = n == 0 or n == edges - 1
            if kind != (2 if outer else n % 2):
                continue
            if cost >= than or cost + spins > than + LEAST_GAIN:
                return False
            a, b = pose_row(poses, n), pose_row(poses, n + 1)
            cost += sweep_cost(grid, discs, weight, a, b) - least_sweep_cost(a, b)
            spins -= spin_cost(a, b)
    return cost < than


@allocating
def pose_arcs(poses: Floats) -> Floats:
    """Return the arc length of the reference point's path at each pose, m, shape (n,)."""
    arcs = np.zeros(len(poses))
    for n in range(len(poses) - 1):
        arcs[n + 1] = arcs[n] + distance(pose_row(poses, n)[:3], pose_row(poses, n + 1)[:3])
    return arcs


@kernel
def pose_at(poses: Floats, arcs: Floats, arc: float) -> tuple[int, Pose]:
    """Return the edge and pose at an arc length of the reference point's path, m."""
    for n in range(len(poses) - 1):
        if arc <= arcs[n + 1] and arcs[n + 1] > arcs[n]:
            share = (arc - arcs[n]) / (arcs[n + 1] - arcs[n])
            return n, pose_between(pose_row(poses, n), pose_row(poses, n + 1), share)
    return len(poses) - 2, pose_row(poses, len(poses) - 1)
