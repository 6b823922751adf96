"""Mixer, attitude control and filter of the quadrotor."""

from math import cos, pi, sin

import numpy as np
import pytest
from scipy.linalg import logm
from scipy.spatial.transform import Rotation

from tests.models.robots.flight import AIRFRAME, GAINS, SMOOTHING, TIMESTEP, build
from wayproof.models.robots.kernel_data import rotation_from_quaternion
from wayproof.models.robots.quadrotor.control_law import (
    ROTOR_SPIN,
    ROTOR_X,
    ROTOR_Y,
    air_drag,
    allocate,
    attitude_error,
    desired_attitude,
    desired_rates,
    desired_torque,
    smooth_setpoint,
    tilt_error,
    tilt_room,
)
from wayproof.models.robots.quadrotor.controller import MEMORY, track
from wayproof.models.robots.quadrotor.parameters import FAST, GRAVITY, Smoothing
from wayproof.models.robots.robot import Setpoint


def test_drag_is_the_closed_form():
    model, data, controller = build()
    controller.reset(data, np.array([0.0, 0.0, 1.0]), 0.0)
    joint, dof = model.joint("robot_root").qposadr[0], model.joint("robot_root").dofadr[0]
    turn = Rotation.from_euler("xyz", [0.3, -0.2, 1.0])
    data.qpos[joint + 3 : joint + 7] = turn.as_quat(scalar_first=True)
    data.qvel[dof : dof + 3] = velocity = np.array([2.0, -1.0, 0.5])
    R = turn.as_matrix()
    controller.wind[:] = wind = np.array([0.5, 3.0, -1.0])
    controller.follow(data, Setpoint((0.0, 0.0, 1.0)))
    airspeed = velocity - wind
    expected = -R @ np.diag([0.25, 0.25, 0.15]) @ R.T @ airspeed
    expected -= 0.02 * np.linalg.norm(airspeed) * airspeed
    applied = data.xfrc_applied[model.body("robot_base").id]
    np.testing.assert_allclose(applied, [*expected, 0.0, 0.0, 0.0], atol=1e-12)


def wrench(rotors):
    """Thrust and body torque of four rotor thrusts, from their lever arms."""
    total = np.zeros(4)
    signs = zip(ROTOR_X, ROTOR_Y, ROTOR_SPIN, strict=True)
    for thrust, (x, y, spin) in zip(rotors, signs, strict=True):
        torque = np.cross([0.14 * x, 0.18 * y, 0.0], [0.0, 0.0, thrust])
        total += [thrust, torque[0], torque[1], spin * 0.0201 * thrust]
    return total


def test_mixer_keeps_limits_and_gives_up_yaw_first():
    rng = np.random.default_rng(1)
    for _ in range(500):
        thrust = rng.uniform(-10.0, 80.0)
        torque = rng.normal(0.0, [3.0, 2.0, 1.0])
        rotors = allocate(AIRFRAME, GAINS, thrust, torque)
        assert rotors.min() >= 0.0
        assert rotors.max() <= 13.0
        got = wrench(rotors)
        spread = 0.5 * (abs(torque[0]) / 0.18 + abs(torque[1]) / 0.14)
        if spread <= 12.87:  # from idle, 1 % of the largest thrust, to the largest
            np.testing.assert_allclose(got[1:3], torque[:2], atol=1e-9)
        else:
            np.testing.assert_allclose(got[1:3], torque[:2] * 12.87 / spread, atol=1e-9)
        assert abs(got[3]) <= abs(torque[2]) + 1e-9
        assert got[3] * torque[2] >= -1e-12


def test_mixer_gives_a_feasible_wrench_exactly():
    rng = np.random.default_rng(2)
    for _ in range(200):
        rotors = rng.uniform(4.0, 7.0, 4)
        demand = wrench(rotors)
        given = allocate(AIRFRAME, GAINS, demand[0], demand[1:])
        np.testing.assert_allclose(given, rotors, atol=1e-9)


@pytest.mark.parametrize(
    ("gains", "thrust", "expected"),
    [
        (GAINS, 0.0, 3.25),  # a quarter of 13 N, whatever the thrust
        (GAINS, 13.0, 3.25),
        (FAST.gains, 9.0, 2.12),  # 9 N / 4 less idle, 1 % of 13 N
        (FAST.gains, 40.0, 3.25),
        (FAST.gains, -3.0, 0.5 * 1.325 * 9.81 / 4 - 0.13),  # as at the least lift
    ],
)
def test_room_for_roll_and_pitch_by_hand(gains, thrust, expected):
    assert tilt_room(AIRFRAME, gains, thrust) == pytest.approx(expected)


def test_attitude_error_matches_the_matrix_formula_and_the_logarithm():
    rng = np.random.default_rng(3)
    for _ in range(50):
        desired, actual = Rotation.random(2, random_state=int(rng.integers(1 << 30))).as_matrix()
        skew = 0.5 * (desired.T @ actual - actual.T @ desired)
        naive = [skew[2, 1], skew[0, 2], skew[1, 0]]
        np.testing.assert_allclose(attitude_error(desired, actual), naive, atol=1e-12)
    small = desired @ Rotation.from_rotvec([0.01, -0.02, 0.015]).as_matrix()
    error = attitude_error(desired, small)
    np.testing.assert_allclose(error, [0.01, -0.02, 0.015], rtol=2e-4)
    logarithm = np.real(logm(desired.T @ small))
    np.testing.assert_allclose(error[2], logarithm[1, 0], rtol=2e-4)


def test_tilt_error_ignores_the_heading_and_is_the_attitude_error_without_one():
    rng = np.random.default_rng(6)
    for _ in range(50):
        actual = Rotation.random(random_state=int(rng.integers(1 << 30)))
        angle, sideways = rng.uniform(0.0, 1.5), rng.uniform(-pi, pi)
        off = angle * np.array([cos(sideways), sin(sideways), 0.0])
        desired = actual * Rotation.from_rotvec(-off)
        expected = sin(angle) * off[:2] / angle
        got = tilt_error(desired.as_matrix(), actual.as_matrix())
        np.testing.assert_allclose(got, expected, atol=1e-12)
        whole = attitude_error(desired.as_matrix(), actual.as_matrix())
        np.testing.assert_allclose([*got, 0.0], whole, atol=1e-12)
        turned = (desired * Rotation.from_rotvec([0.0, 0.0, 1.0])).as_matrix()
        np.testing.assert_allclose(tilt_error(turned, actual.as_matrix()), expected, atol=1e-12)


def smooth_reference(t):
    """Rows position .. snap of a smooth curve with heading, by exact derivatives."""
    rows = np.empty((5, 4))
    for channel, (size, rate) in enumerate([(2.0, 0.9), (1.5, 1.3), (0.3, 1.1), (1.2, 0.7)]):
        for order in range(5):
            rows[order, channel] = size * rate**order * sin(rate * t + order * pi / 2)
    return rows


def desired_rotation(t):
    reference = smooth_reference(t)
    return desired_attitude(reference[2, :3] + [0.0, 0.0, GRAVITY], reference[0, 3])


def test_demanded_rates_are_the_derivative_of_the_demanded_attitude():
    step = 1e-5
    for t in np.linspace(0.0, 5.0, 11):
        reference = smooth_reference(t)
        R = desired_rotation(t)
        lift = float(np.linalg.norm(reference[2, :3] + [0.0, 0.0, GRAVITY]))
        rate, acceleration = desired_rates(reference, R, lift)
        change = desired_rotation(t - step).T @ desired_rotation(t + step)
        measured = Rotation.from_matrix(change).as_rotvec() / (2 * step)
        np.testing.assert_allclose(rate, measured, atol=1e-6)

        def rate_at(time):
            ahead = smooth_reference(time)
            norm = float(np.linalg.norm(ahead[2, :3] + [0.0, 0.0, GRAVITY]))
            return desired_rates(ahead, desired_rotation(time), norm)[0]

        slope = (rate_at(t + step) - rate_at(t - step)) / (2 * step)
        np.testing.assert_allclose(acceleration[:2], slope[:2], atol=1e-4)


def test_demanded_attitude_is_a_rotation_that_faces_the_heading():
    R = desired_attitude(np.array([1.0, -2.0, 9.0]), 0.8)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    np.testing.assert_allclose(R[:, 2], np.array([1.0, -2.0, 9.0]) / np.sqrt(86.0), atol=1e-12)
    assert R[:, 1] @ [cos(0.8), sin(0.8), 0.0] == pytest.approx(0.0, abs=1e-12)


def test_filter_is_four_equal_poles():
    slow = Smoothing(limits=(1e9,) * 4, heading_limits=(1e9,) * 4)
    reference = np.zeros((5, 4))
    for _ in range(101):
        smooth_setpoint(slow, reference, np.array([1.0, 0.0, 0.0, 0.5]), TIMESTEP)
    x = 20.0 * 100 * TIMESTEP
    expected = 1.0 - np.exp(-x) * (1 + x + x**2 / 2 + x**3 / 6)  # step response of 1/(1+s/b)^4
    assert reference[0, 0] == pytest.approx(expected, abs=0.01)
    assert reference[0, 3] == pytest.approx(expected / 2, abs=0.005)


def test_filter_lags_by_what_it_says():
    reference = np.zeros((5, 4))
    for tick in range(2000):
        target = np.array([1.5 * tick * TIMESTEP, 0.0, 0.0, 0.0])
        smooth_setpoint(SMOOTHING, reference, target, TIMESTEP)
    assert SMOOTHING.lag == pytest.approx(0.2)
    assert target[0] - reference[0, 0] == pytest.approx(1.5 * SMOOTHING.lag, abs=1e-6)
    np.testing.assert_allclose(reference[1:, 0], [1.5, 0.0, 0.0, 0.0], atol=1e-6)


def test_filter_keeps_its_limits():
    reference = np.zeros((5, 4))
    peaks = np.zeros(4)
    for _ in range(3000):
        smooth_setpoint(SMOOTHING, reference, np.array([9.0, 5.0, 2.0, 0.0]), TIMESTEP)
        peaks = np.maximum(peaks, np.linalg.norm(reference[1:, :3], axis=1))
    assert np.all(peaks <= np.multiply(SMOOTHING.limits, 1.02))
    assert peaks[0] > 2.9
    np.testing.assert_allclose(reference[0, :3], [9.0, 5.0, 2.0], atol=0.01)


def test_kernels_equal_their_python():
    rng = np.random.default_rng(4)
    quaternion = np.array([*Rotation.random(random_state=5).as_quat()])
    pose, velocity = np.concatenate([[0.1, 0.2, 0.3], quaternion]), rng.normal(size=6)
    results = []
    for run in (track, track.py_func):
        memory, command = np.zeros(1, MEMORY).view(np.recarray), np.zeros(4)
        memory[0].reference[:], memory[0].lag[:] = smooth_reference(0.4), 3.0
        run(AIRFRAME, GAINS, memory[0], pose, velocity, TIMESTEP, command)
        results.append(np.concatenate([memory[0].integral, memory[0].lag.ravel(), command]))
    assert results[0][:3].any()
    np.testing.assert_allclose(results[0], results[1], rtol=1e-12)
    results = []
    for run in (smooth_setpoint, smooth_setpoint.py_func):
        reference = smooth_reference(0.4)
        run(SMOOTHING, reference, np.array([1.0, 2.0, 3.0, 9.0]), TIMESTEP)
        results.append(reference)
    np.testing.assert_allclose(results[0], results[1], rtol=1e-12)
    results = []
    for run in (rotation_from_quaternion, rotation_from_quaternion.py_func):
        results.append(np.empty((3, 3)))
        run(quaternion, results[-1])
    np.testing.assert_allclose(results[0], results[1], rtol=1e-12)
    R, torque = desired_rotation(1.0), np.array([1.0, -0.5, 0.2])
    rates = torque, 3.0 * torque
    for kernel, arguments in (
        (desired_attitude, (np.array([1.0, 2.0, 9.0]), 0.3)),
        (attitude_error, (R, desired_rotation(1.1))),
        (desired_torque, (AIRFRAME, FAST.gains, R, desired_rotation(1.1), rates, torque, 9.0)),
        (tilt_error, (R, desired_rotation(1.1))),
        (tilt_room, (AIRFRAME, FAST.gains, 9.0)),
        (desired_rates, (smooth_reference(1.0), R, 11.0)),
        (allocate, (AIRFRAME, GAINS, 13.0, torque)),
        (air_drag, (AIRFRAME, R, torque)),
    ):
        np.testing.assert_allclose(kernel(*arguments), kernel.py_func(*arguments), rtol=1e-12)
