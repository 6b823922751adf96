"""Alignment of a sweep with the planes of a map, and how well it lies on them."""

from __future__ import annotations

from math import cos, isfinite, sin
from typing import NamedTuple

import numpy as np

from wayproof.harness.estimators.matrices import diagonalize, solve
from wayproof.harness.estimators.voxels import (
    FLATNESS,
    Voxels,
    distance_from_plane,
    is_known,
    slot_of,
    voxel_key,
)
from wayproof.kernel_compiler import allocating, kernel
from wayproof.models.arrays import Array

LEAST_INLIERS = 20
"""Number of points below which a sweep is not registered."""

ITERATIONS = 10

COARSE = 3
"""Number of the first iterations, in which the gate is twice as wide."""

GATE = 0.15
"""Largest distance of a point from its plane, m."""

NEAR = 2.0 * FLATNESS
"""Distance from its plane up to which a point agrees with it, m: points that are scattered over a
voxel lie within the gate of any plane through it."""

SCALE = 0.02
"""Scale of the Cauchy weight of that distance, m."""

CONVERGED = 1e-5
"""Step of the pose, m and rad, below which the iteration ends."""

FIXED = 1e3
"""Weight, in all points, with which the prediction stays along a direction that is not held."""


class Alignment(NamedTuple):
    """Where a sweep lies on the planes of the map.

    Attributes:
        correction: (4,) shift, m, and turn about the vertical through the base, rad.
        information: (3,) eigenvalues of the mean of n n'.
        axes: (3, 3) their directions, in columns.
    """

    correction: Array
    information: Array
    axes: Array


@allocating
def align(
    offsets: Array, predicted: Array, held: float, prior: Array, voxels: Voxels, found: Alignment
) -> tuple[int, int, int]:
    """Align a sweep with the planes of the map, by Gauss-Newton on the distances from them.

    Args:
        offsets: (n, 3) points from the predicted position of the base, world axes, m.
        predicted: (3,) that position, m.
        held: Least information of a direction that the scene holds.
        prior: (4, 4) by which the prediction counts, in terms of the mean of g g' over the points,
            g the gradient of the distance by the pose.
        voxels: The map.
        found: Written.

    Returns:
        Number of points within the gate of a plane, of those that agree with it, and of points in
        known voxels. With less than `LEAST_INLIERS` of the first there is no correction.
    """
    correction, information, axes = found
    correction[:], information[:] = 0.0, 0.0
    diagonalize(np.zeros((3, 3)), axes)
    equations, right, moment = np.empty((4, 4)), np.empty(4), np.empty((3, 3))
    inliers, near, known = 0, 0, 0
    for iteration in range(ITERATIONS):
        gate = 2.0 * GATE if iteration < COARSE else GATE
        inliers, near, known, weight = sum_up(
            offsets, predicted, correction, gate, voxels, equations, right, moment
        )
        if inliers < LEAST_INLIERS:
            correction[:], information[:] = 0.0, 0.0
            diagonalize(np.zeros((3, 3)), axes)
            return inliers, near, known
        diagonalize(moment, axes)
        for axis in range(3):
            information[axis] = moment[axis, axis]
            if information[axis] < held:
                hold_to_prediction(equations, right, correction, axes[:, axis], FIXED * weight)
        for i in range(4):
            for j in range(4):
                equations[i, j] += prior[i, j] * weight
                right[i] -= prior[i, j] * weight * correction[j]
        solve(equations, right)
        largest = 0.0
        for row in range(4):
            correction[row] += right[row]
            largest = max(largest, abs(right[row]))
        if largest < CONVERGED:
            break
    return inliers, near, known


@allocating
def sum_up(
    offsets: Array, predicted: Array, correction: Array, gate: float, voxels: Voxels,
    equations: Array, right: Array, moment: Array,
) -> tuple[int, int, int, float]:  # fmt: skip
    """Sum up the normal equations (4, 4) and (4,), and the weighted mean of n n' (3, 3).

    Returns:
        The three numbers of `align`, and the sum of the weights.
    """
    equations[:], right[:], moment[:] = 0.0, 0.0, 0.0
    c, s = cos(correction[3]), sin(correction[3])
    bx, by = predicted[0] + correction[0], predicted[1] + correction[1]
    bz = predicted[2] + correction[2]
    viewer, row = np.array((bx, by, bz)), np.empty(4)
    inliers, near, known, total = 0, 0, 0, 0.0
    for index in range(len(offsets)):
        ox, oy = offsets[index, 0], offsets[index, 1]
        rx, ry = c * ox - s * oy, s * ox + c * oy
        x, y, z = bx + rx, by + ry, bz + offsets[index, 2]
        slot = slot_of(voxels.keys, voxel_key(x, y, z, voxels.inverse))
        known += is_known(voxels, slot, viewer)
        distance = distance_from_plane(voxels, slot, x, y, z, viewer)
        if abs(distance) > gate:
            continue
        near += abs(distance) <= NEAR
        plane = voxels.planes[slot]
        weight = 1.0 / (1.0 + (distance / SCALE) ** 2)
        row[0], row[1], row[2] = plane[0], plane[1], plane[2]
        row[3] = plane[1] * rx - plane[0] * ry
        for i in range(4):
            right[i] -= weight * row[i] * distance
            for j in range(4):
                equations[i, j] += weight * row[i] * row[j]
        inliers += 1
        total += weight
    for i in range(3):
        for j in range(3):
            moment[i, j] = equations[i, j] / total if total > 0.0 else 0.0
    return inliers, near, known, total


@kernel
def hold_to_prediction(
    equations: Array, right: Array, correction: Array, axis: Array, weight: float
) -> None:
    """Add to the normal equations that the prediction stays along an axis (3,)."""
    along = axis[0] * correction[0] + axis[1] * correction[1] + axis[2] * correction[2]
    for i in range(3):
        right[i] -= weight * axis[i] * along
        for j in range(3):
            equations[i, j] += weight * axis[i] * axis[j]


@allocating
def examine(
    offsets: Array, predicted: Array, correction: Array, voxels: Voxels,
    distances: Array, moment: Array, scatter: Array, shares: Array,
) -> int:  # fmt: skip
    """Measure how an aligned sweep lies on the planes of the map.

    Args:
        offsets: As of `align`.
        predicted: As of `align`.
        correction: (4,) of `align`.
        voxels: The map.
        distances: (n,) of the points near a plane from it, without sign, m; the first ones are
            written.
        moment: (4, 4) mean of g g' over these points, g the gradient of the distance by the pose;
            written.
        scatter: (4, 4) mean of w^2 d^2 g g' over them by the square of the mean of w, m^2: d the
            distance, w its weight in `align`; written.
        shares: (k, 4) by the sweeps of their voxels: sum of the squares of g; added to.

    Returns:
        Number of these points.
    """
    moment[:], scatter[:] = 0.0, 0.0
    c, s = cos(correction[3]), sin(correction[3])
    bx, by = predicted[0] + correction[0], predicted[1] + correction[1]
    bz = predicted[2] + correction[2]
    viewer, row = np.array((bx, by, bz)), np.empty(4)
    inliers, total = 0, 0.0
    for index in range(len(offsets)):
        ox, oy = offsets[index, 0], offsets[index, 1]
        rx, ry = c * ox - s * oy, s * ox + c * oy
        x, y, z = bx + rx, by + ry, bz + offsets[index, 2]
        slot = slot_of(voxels.keys, voxel_key(x, y, z, voxels.inverse))
        distance = abs(distance_from_plane(voxels, slot, x, y, z, viewer))
        if distance > GATE:
            continue
        distances[inliers] = distance
        inliers += 1
        plane = voxels.planes[slot]
        row[0], row[1], row[2] = plane[0], plane[1], plane[2]
        row[3] = plane[1] * rx - plane[0] * ry
        weight = 1.0 / (1.0 + (distance / SCALE) ** 2)
        total += weight
        sweep = voxels.sweeps[slot]
        for i in range(4):
            shares[sweep, i] += row[i] * row[i]
            for j in range(4):
                moment[i, j] += row[i] * row[j]
                scatter[i, j] += (weight * distance) ** 2 * row[i] * row[j]
    moment /= max(inliers, 1)
    scatter *= inliers / max(total, 1.0) ** 2
    return inliers


@kernel
def count_on_planes(
    points: Array, viewer: Array, voxels: Voxels, least: int
) -> tuple[int, int, int]:
    """Count points (n, 3), m, that agree with a plane, that have one, and in known voxels.

    Known are those of `least` points and more.
    """
    near, planar, known = 0, 0, 0
    for index in range(len(points)):
        x, y, z = points[index, 0], points[index, 1], points[index, 2]
        slot = slot_of(voxels.keys, voxel_key(x, y, z, voxels.inverse))
        known += voxels.counts[slot] >= least and is_known(voxels, slot, viewer)
        distance = abs(distance_from_plane(voxels, slot, x, y, z, viewer))
        planar += isfinite(distance)
        near += distance <= NEAR
    return near, planar, known
