"""Quadratic programs over friction cones by the alternating direction method of multipliers.

The cone is split off (Boyd et al. 2011, section 5): one Cholesky factorisation, then solves and
projections in turn, a fixed number of times. Loops run along rows so that they vectorise without
reordering sums; nothing here depends on a linear algebra library.
"""

from __future__ import annotations

from math import hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from wayproof.models._jit import allocating, kernel
from wayproof.models.arrays import Array
from wayproof.models.robots.quadruped.parameters import Prediction

Slots = NDArray[np.int64]


@allocating
def solve_forces(
    prediction: Prediction, slots: Slots, hessian: Array, gradient: Array, warm: Array
) -> None:
    """Minimise 1/2 f'Hf + g'f with every force in its friction cone.

    Args:
        prediction: Friction, force limit, penalty and iterations.
        slots: (m, 2) step and leg of each force.
        hessian: (3 m, 3 m) upper triangle of H; used up.
        gradient: (3 m,) g.
        warm: (2, n, 4, 3) forces (N, always inside their cones) and scaled duals of the last
            solve by step and leg, zero where no foot stands; replaced by this one's.
    """
    for i in range(len(hessian)):
        hessian[i, i] += prediction.penalty
    lower = _factorise(hessian)
    z, u = _gather(slots, warm)
    for _ in range(prediction.iterations):
        x = prediction.penalty * (z - u) - gradient
        _substitute(hessian, lower, x)
        _project_all(prediction, x, z, u)
    _scatter(slots, z, u, warm)


@allocating
def _factorise(matrix: Array) -> Array:
    """Return U' of A = U'U (Cholesky); U replaces the upper triangle, its diagonal inverted.

    Slices from zero, because the compiler vectorises loops whose indices cannot be negative.
    """
    n = len(matrix)
    for k in range(n):
        row = matrix[k, k:]
        scale = 1.0 / sqrt(row[0])
        for j in range(len(row)):
            row[j] *= scale
        for i in range(1, len(row)):
            below, right = matrix[k + i, k + i :], row[i:]
            pivot = right[0]
            for j in range(len(below)):
                below[j] -= pivot * right[j]
        row[0] = scale
    lower = np.empty((n, n))
    for i in range(n):
        for j in range(i):
            lower[i, j] = matrix[j, i]
    return lower


@kernel
def _substitute(upper: Array, lower: Array, x: Array) -> None:
    """Replace x by A^-1 x, given both triangles of the factor; inverses on upper's diagonal."""
    for k in range(len(x)):
        x[k] *= upper[k, k]
        known, row, rest = x[k], upper[k, k + 1 :], x[k + 1 :]
        for j in range(len(row)):
            rest[j] -= known * row[j]
    for k in range(len(x) - 1, -1, -1):
        x[k] *= upper[k, k]
        known, row = x[k], lower[k, :k]
        for j in range(len(row)):
            x[j] -= known * row[j]


@kernel
def project(friction: float, largest: float, x: float, y: float, z: float) -> tuple[float, ...]:
    """Return the nearest force with hypot(x, y) <= friction z and z <= largest.

    The second-order cone's projection (Parikh and Boyd 2014, section 6.3.2); where that is above
    the lid z = largest, the answer lies on the lid.
    """
    side = hypot(x, y)
    if side <= friction * z:
        along, up = side, z
    elif friction * side <= -z:
        along, up = 0.0, 0.0
    else:
        up = (friction * side + z) / (1.0 + friction * friction)
        along = friction * up
    if up > largest:
        along, up = min(side, friction * largest), largest
    scale = along / side if side > 0.0 else 0.0
    return x * scale, y * scale, up


@kernel
def _project_all(prediction: Prediction, x: Array, z: Array, u: Array) -> None:
    """Take the z and u steps of scaled ADMM (Boyd et al. 2011, eq. 3.6, 3.7)."""
    mu, largest = prediction.friction, prediction.largest_normal_force
    for i in range(0, len(x), 3):
        a, b, c = x[i] + u[i], x[i + 1] + u[i + 1], x[i + 2] + u[i + 2]
        z[i], z[i + 1], z[i + 2] = project(mu, largest, a, b, c)
        u[i], u[i + 1], u[i + 2] = a - z[i], b - z[i + 1], c - z[i + 2]


@allocating
def _gather(slots: Slots, warm: Array) -> tuple[Array, Array]:
    z = np.empty(3 * len(slots))
    u = np.empty(3 * len(slots))
    for s in range(len(slots)):
        for j in range(3):
            z[3 * s + j] = warm[0, slots[s, 0], slots[s, 1], j]
            u[3 * s + j] = warm[1, slots[s, 0], slots[s, 1], j]
    return z, u


@kernel
def _scatter(slots: Slots, z: Array, u: Array, warm: Array) -> None:
    warm[:] = 0.0
    for s in range(len(slots)):
        for j in range(3):
            warm[0, slots[s, 0], slots[s, 1], j] = z[3 * s + j]
            warm[1, slots[s, 0], slots[s, 1], j] = u[3 * s + j]
