"""The quadratic program against a simulated horizon and scipy, and the parts of its solver."""

import numpy as np
import pytest

from wayproof.models.robots.quadruped.mpc import GRAVITY, condense, project, solve_forces
from wayproof.models.robots.quadruped.parameters import Prediction
from wayproof.models.robots.quadruped.reference import Horizon

MASS = 15.0
INERTIA = np.array([[0.16, 0.0, -0.016], [0.0, 0.47, 0.0], [-0.016, 0.0, 0.52]])
FEET = np.array(
    [[0.19, 0.14, -0.28], [0.19, -0.14, -0.28], [-0.19, 0.14, -0.28], [-0.19, -0.14, -0.28]]
)


def problem(steps, seed):
    """A random state near a random reference, with a trot's contacts."""
    rng = np.random.default_rng(seed)
    state = 0.1 * rng.normal(size=12)
    state[2] = 0.7
    reference = 0.1 * rng.normal(size=(steps, 12))
    reference[:, 2] += 0.7
    contact = np.array([[k % 4 < 2, k % 4 != 1, k % 4 != 2, k % 4 < 2] for k in range(steps)])
    lever = FEET + 0.03 * rng.normal(size=(steps, 4, 3))
    return state, reference, contact, lever


def cost(prediction, state, reference, contact, lever, force):
    """The horizon's cost by carrying the body on step by step; force is (n, 4, 3)."""
    dt, (angle, place, spin, speed) = prediction.step_time, state.reshape(4, 3)
    c, s = np.cos(state[2]), np.sin(state[2])
    Rz = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    inverse = np.linalg.inv(Rz @ INERTIA @ Rz.T)
    weights = np.concatenate(
        [
            prediction.weight_angle,
            prediction.weight_position,
            prediction.weight_angular_velocity,
            prediction.weight_velocity,
        ]
    )
    total = 0.5 * prediction.weight_force * np.sum(force[contact] ** 2)
    for k in range(len(reference)):
        push = force[k][contact[k]].sum(axis=0) / MASS - [0.0, 0.0, GRAVITY]
        moment = inverse @ np.cross(lever[k], force[k])[contact[k]].sum(axis=0)
        angle = angle + Rz.T @ (dt * spin + 0.5 * dt**2 * moment)
        place = place + dt * speed + 0.5 * dt**2 * push
        spin, speed = spin + dt * moment, speed + dt * push
        error = np.concatenate([angle, place, spin, speed]) - reference[k]
        total += 0.5 * weights @ error**2
    return total


def dense(upper):
    return np.triu(upper) + np.triu(upper, 1).T


def condensed(prediction, inputs):
    return condense(prediction, MASS, np.linalg.inv(INERTIA), Horizon(*inputs))


@pytest.mark.parametrize("seed", range(3))
def test_program_is_the_simulated_cost(seed):
    prediction = Prediction(steps=6)
    inputs = problem(6, seed)
    slots, hessian, gradient = condensed(prediction, inputs)
    rng = np.random.default_rng(seed)
    nothing = cost(prediction, *inputs, np.zeros((6, 4, 3)))
    for _ in range(3):
        force = 100.0 * rng.normal(size=(6, 4, 3))
        f = force[slots[:, 0], slots[:, 1]].ravel()
        program = 0.5 * f @ dense(hessian) @ f + gradient @ f
        assert program == pytest.approx(cost(prediction, *inputs, force) - nothing, rel=1e-9)


def test_compiled_program_equals_python():
    prediction, inputs = Prediction(steps=4), problem(4, 1)
    compiled = condensed(prediction, inputs)
    python = condense.py_func(prediction, MASS, np.linalg.inv(INERTIA), Horizon(*inputs))
    np.testing.assert_array_equal(compiled[0], python[0])
    for ours, theirs in zip(compiled[1:], python[1:], strict=True):
        upper = np.triu if ours.ndim == 2 else np.asarray
        np.testing.assert_allclose(upper(ours), upper(theirs), rtol=1e-12, atol=1e-18)


def solved(prediction, slots, hessian, gradient):
    warm = np.zeros((2, prediction.steps, 4, 3))
    solve_forces(prediction, slots, hessian.copy(), gradient, warm)
    return warm[0][slots[:, 0], slots[:, 1]]  # (m, 3)


@pytest.mark.parametrize("seed", range(4))
def test_solver_reaches_a_fixed_point_of_projected_gradient(seed):
    """f minimises a convex function over a convex set just if f = P(f - t grad) for any t > 0."""
    prediction = Prediction(steps=3, iterations=4000)
    slots, hessian, gradient = condensed(prediction, problem(3, seed))
    force = solved(prediction, slots, hessian, gradient)
    descended = force.ravel() - 1e5 * (dense(hessian) @ force.ravel() + gradient)
    limits = prediction.friction, prediction.largest_normal_force
    again = [project.py_func(*limits, *f) for f in descended.reshape(-1, 3)]
    np.testing.assert_allclose(force, again, atol=0.02)


def test_compiled_solver_equals_python():
    prediction = Prediction(steps=2)
    slots, hessian, gradient = condensed(prediction, problem(2, 3))
    compiled, python = np.zeros((2, 2, 4, 3)), np.zeros((2, 2, 4, 3))
    solve_forces(prediction, slots, hessian.copy(), gradient, compiled)
    solve_forces.py_func(prediction, slots, hessian.copy(), gradient, python)
    np.testing.assert_allclose(compiled, python, rtol=1e-10, atol=1e-12)
    assert np.abs(compiled[0]).max() > 1.0


def test_fifteen_warm_iterations_come_close_to_the_answer():
    rough, exact = Prediction(), Prediction(iterations=3000)
    slots, hessian, gradient = condensed(rough, problem(10, 0))
    near, far = np.zeros((2, 10, 4, 3)), np.zeros((2, 10, 4, 3))
    for _ in range(3):
        solve_forces(rough, slots, hessian.copy(), gradient, near)
    solve_forces(exact, slots, hessian.copy(), gradient, far)
    assert np.abs(near[0, 0] - far[0, 0]).max() < 0.1 * np.abs(far[0, 0]).max()


def test_standing_still_shares_the_weight():
    prediction = Prediction(iterations=2000)
    contact = np.ones((10, 4), np.bool_)
    still = np.zeros(12), np.zeros((10, 12)), contact, np.tile(FEET, (10, 1, 1))
    slots, hessian, gradient = condensed(prediction, still)
    warm = np.zeros((2, 10, 4, 3))
    solve_forces(prediction, slots, hessian, gradient, warm)
    np.testing.assert_allclose(warm[0, 0, :, :2], 0.0, atol=0.5)
    assert warm[0, 0, :, 2].sum() == pytest.approx(MASS * GRAVITY, rel=0.02)


def test_no_foot_on_the_ground_plans_no_force():
    prediction = Prediction(steps=2)
    state, reference, contact, lever = problem(2, 0)
    slots, hessian, gradient = condensed(prediction, (state, reference, contact & False, lever))
    warm = np.ones((2, 2, 4, 3))
    solve_forces(prediction, slots, hessian, gradient, warm)
    assert slots.shape == (0, 2)
    assert not warm.any()


@pytest.mark.parametrize(
    ("force", "expected"),
    [
        ((1.0, 1.0, 10.0), (1.0, 1.0, 10.0)),  # inside
        ((0.0, 0.0, -5.0), (0.0, 0.0, 0.0)),  # in the polar cone
        ((1.0, 0.0, -2.0), (0.0, 0.0, 0.0)),
        ((10.0, 0.0, 0.0), (2.0, 0.0, 4.0)),  # onto the ray (1/2, 1): 5 / (1 + 1/4) = 4
        ((0.0, -10.0, 0.0), (0.0, -2.0, 4.0)),
        ((3.0, 4.0, 300.0), (3.0, 4.0, 100.0)),  # over the lid
        ((600.0, 0.0, 300.0), (50.0, 0.0, 100.0)),  # onto the rim
    ],
)
def test_projection_of_known_forces(force, expected):
    np.testing.assert_allclose(project(0.5, 100.0, *force), expected, atol=1e-12)


def test_projection_is_nearest_and_repeatable():
    rng = np.random.default_rng(0)
    mu, lid = 0.6, 50.0
    up = rng.uniform(0.0, lid, 2000)
    angle, side = rng.uniform(-np.pi, np.pi, 2000), mu * up * np.sqrt(rng.uniform(size=2000))
    feasible = np.stack([side * np.cos(angle), side * np.sin(angle), up], axis=1)  # (2000, 3)
    for force in rng.normal(scale=60.0, size=(200, 3)):
        nearest = np.array(project(mu, lid, *force))
        assert np.hypot(*nearest[:2]) <= mu * nearest[2] + 1e-9
        assert nearest[2] <= lid
        np.testing.assert_allclose(project(mu, lid, *nearest), nearest, atol=1e-9)
        distance = np.linalg.norm(feasible - force, axis=1).min()
        assert np.linalg.norm(nearest - force) <= distance + 1e-9
        np.testing.assert_allclose(project.py_func(mu, lid, *force), nearest, rtol=1e-13)
