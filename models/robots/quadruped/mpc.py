"""Convex model-predictive control of ground forces (Di Carlo et al. 2018), condensed.

The body is one rigid body with small roll and pitch; a force f on a foot in contact during one
step of the horizon changes velocity by f dt / m and angular velocity by I^-1 (r x f) dt. States
are eliminated (Di Carlo et al. 2018, eq. 29-32), so that the unknowns are the forces of the feet
in contact alone: minimise 1/2 f'Hf + g'f with every force in its friction cone.

That is solved by the alternating direction method of multipliers with the cone split off (Boyd et
al. 2011, section 5): one Cholesky factorisation, then solves and projections in turn, a fixed
number of times. Loops run along rows so that they vectorise without reordering sums; nothing here
depends on a linear algebra library.
"""

from __future__ import annotations

from math import cos, hypot, sin, sqrt

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import allocating, kernel
from wayproof.models.arrays import Array
from wayproof.models.robots.quadruped.parameters import Prediction
from wayproof.models.robots.quadruped.reference import Horizon

Slots = NDArray[np.int64]

GRAVITY = 9.81
"""Acceleration of free fall, m/s^2."""


@allocating
def condense(
    prediction: Prediction,
    mass: float,
    inverse_inertia: Array,
    horizon: Horizon,
) -> tuple[Slots, Array, Array]:
    """Build the quadratic program that steers the state along the reference over n steps.

    Args:
        prediction: Weights and horizon.
        mass: kg.
        inverse_inertia: (3, 3) about the centre of mass, body frame, 1/(kg m^2).
        horizon: State, reference, contacts and lever arms.

    Returns:
        (m, 2) step and leg of every force that exists, the upper triangle of H (3 m, 3 m), and
        g (3 m,).
    """
    state, reference, contact, lever = horizon
    slots = _slots(contact)
    spin, turn = _angular_maps(slots, state[2], inverse_inertia, lever)
    hessian = _hessian(prediction, mass, slots, spin, turn)
    gradient = _gradient(prediction, mass, slots, spin, turn, state, reference)
    return slots, hessian, gradient


@allocating
def _slots(contact: NDArray[np.bool_]) -> Slots:
    """Return step and leg of every force that exists, (m, 2)."""
    slots = np.empty((contact.size, 2), np.int64)
    count = 0
    for step in range(contact.shape[0]):
        for leg in range(4):
            if contact[step, leg]:
                slots[count, 0] = step
                slots[count, 1] = leg
                count += 1
    return slots[:count]


@allocating
def _angular_maps(
    slots: Slots, yaw: float, inverse_inertia: Array, lever: Array
) -> tuple[Array, Array]:
    """Return per slot I^-1 [r]x, world, and Rz' of it, which drives the angles (eq. 12, 17)."""
    c, s = cos(yaw), sin(yaw)
    Rz = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    inverse_world = np.zeros((3, 3))
    for i, j, a, b in np.ndindex(3, 3, 3, 3):
        inverse_world[i, j] += Rz[i, a] * inverse_inertia[a, b] * Rz[j, b]
    spin = np.empty((len(slots), 3, 3))
    turn = np.zeros((len(slots), 3, 3))
    for slot in range(len(slots)):
        r = lever[slots[slot, 0], slots[slot, 1]]
        for i in range(3):
            w = inverse_world[i]
            spin[slot, i, 0] = w[1] * r[2] - w[2] * r[1]
            spin[slot, i, 1] = w[2] * r[0] - w[0] * r[2]
            spin[slot, i, 2] = w[0] * r[1] - w[1] * r[0]
        for j in range(3):
            turn[slot, 0, j] = c * spin[slot, 0, j] + s * spin[slot, 1, j]
            turn[slot, 1, j] = c * spin[slot, 1, j] - s * spin[slot, 0, j]
            turn[slot, 2, j] = spin[slot, 2, j]
    return spin, turn


@allocating
def _overlaps(steps: int, step_time: float) -> tuple[Array, Array]:
    """Return (n, n) sums over the horizon of how two steps' forces move positions and velocities.

    A force during step i moves the position at the end of step k - 1 by (k - i - 1/2) dt^2 / m.
    """
    position = np.zeros((steps, steps))
    velocity = np.zeros((steps, steps))
    for i in range(steps):
        for j in range(steps):
            for k in range(max(i, j) + 1, steps + 1):
                position[i, j] += (k - i - 0.5) * (k - j - 0.5) * step_time**4
                velocity[i, j] += step_time**2
    return position, velocity


@allocating
def _hessian(
    prediction: Prediction, mass: float, slots: Slots, spin: Array, turn: Array
) -> Array:  # (3 m, 3 m)
    """Return the upper triangle (by 3 x 3 blocks) of H."""
    position, velocity = _overlaps(prediction.steps, prediction.step_time)
    turn_weighted = turn * np.array(prediction.weight_angle).reshape(3, 1)
    spin_weighted = spin * np.array(prediction.weight_angular_velocity).reshape(3, 1)
    hessian = np.empty((3 * len(slots), 3 * len(slots)))
    for s in range(len(slots)):
        for t in range(s, len(slots)):
            p = position[slots[s, 0], slots[t, 0]]
            v = velocity[slots[s, 0], slots[t, 0]]
            for i in range(3):
                for j in range(3):
                    angle = 0.0
                    rate = 0.0
                    for e in range(3):
                        angle += turn_weighted[s, e, i] * turn[t, e, j]
                        rate += spin_weighted[s, e, i] * spin[t, e, j]
                    hessian[3 * s + i, 3 * t + j] = p * angle + v * rate
                linear = p * prediction.weight_position[i] + v * prediction.weight_velocity[i]
                hessian[3 * s + i, 3 * t + i] += linear / mass**2
    for i in range(len(hessian)):
        hessian[i, i] += prediction.weight_force
    return hessian


@allocating
def _free_errors(prediction: Prediction, state: Array, reference: Array) -> Array:  # (n, 12)
    """Return weighted errors of a body without ground forces: constant velocity and gravity."""
    c, s = cos(state[2]), sin(state[2])
    rates = (c * state[6] + s * state[7], c * state[7] - s * state[6], state[8])
    errors = np.empty_like(reference)
    for k in range(len(reference)):
        t = (k + 1) * prediction.step_time
        for i in range(3):
            fall = -GRAVITY if i == 2 else 0.0
            angle = state[i] + t * rates[i]
            position = state[3 + i] + t * state[9 + i] + 0.5 * t * t * fall
            errors[k, i] = prediction.weight_angle[i] * (angle - reference[k, i])
            errors[k, 3 + i] = prediction.weight_position[i] * (position - reference[k, 3 + i])
            errors[k, 6 + i] = prediction.weight_angular_velocity[i] * (
                state[6 + i] - reference[k, 6 + i]
            )
            errors[k, 9 + i] = prediction.weight_velocity[i] * (
                state[9 + i] + t * fall - reference[k, 9 + i]
            )
    return errors


@allocating
def _gradient(
    prediction: Prediction,
    mass: float,
    slots: Slots,
    spin: Array,
    turn: Array,
    state: Array,
    reference: Array,
) -> Array:  # (3 m,)
    errors = _free_errors(prediction, state, reference)
    dt = prediction.step_time
    effect = np.zeros((len(errors), 12))  # errors weighted by the effect of each step's force
    for step in range(len(errors)):
        for k in range(step, len(errors)):
            for i in range(6):
                effect[step, i] += (k - step + 0.5) * dt * dt * errors[k, i]
                effect[step, 6 + i] += dt * errors[k, 6 + i]
    gradient = np.empty(3 * len(slots))
    for s in range(len(slots)):
        e = effect[slots[s, 0]]
        for j in range(3):
            total = (e[3 + j] + e[9 + j]) / mass
            for i in range(3):
                total += turn[s, i, j] * e[i] + spin[s, i, j] * e[6 + i]
            gradient[3 * s + j] = total
    return gradient


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
