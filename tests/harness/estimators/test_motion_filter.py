"""Kalman filter of the motion between sweeps, against filters written out by hand."""

import numpy as np
import pytest

from wayproof.harness.estimator_config import EstimateConfig
from wayproof.harness.estimators.matrices import inverse
from wayproof.harness.estimators.motion_filter import (
    BIAS_CORRELATION_S,
    LEAST_VARIANCE,
    MotionFilter,
)


def test_the_inverse_is_numpys():
    rng = np.random.default_rng(0)
    root = rng.standard_normal((4, 7))
    np.testing.assert_allclose(inverse(root @ root.T), np.linalg.inv(root @ root.T), rtol=1e-9)


UPRIGHT = np.eye(3)
"""Axes of a base that stands as the world does."""


ALL_HELD = np.zeros((0, 3))
"""Directions that a sweep does not hold: none."""


def turned(angle):
    """Axes of a base that was turned about the vertical by an angle, rad."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


class Rough(EstimateConfig):
    accelerometer_bias, accelerometer_noise = 0.5, 0.1


class Biased(EstimateConfig):
    accelerometer_bias = 0.1


class SteadyLegs(EstimateConfig):
    leg_noise = 0.0


def test_position_velocity_and_bias_are_those_of_a_textbook_filter():
    """One axis of it, with the state (x, v, b), and a position measured after each period T."""
    config = Rough()
    motion, period = MotionFilter(config), 0.1
    P = np.diag([LEAST_VARIANCE, 0.0, 0.5**2])
    F = np.array([[1.0, period, -0.5 * period**2], [0.0, 1.0, -period], [0.0, 0.0, 1.0]])
    Q = period * np.diag([0.0, 0.1**2, 0.5**2 / BIAS_CORRELATION_S])
    H, R = np.array([[1.0, 0.0, 0.0]]), 0.01**2
    every = np.diag([1 / R, 1 / R, 1 / R, 1.0])
    for _ in range(20):
        before = P[0, 0]
        grown = motion.predict(np.zeros(3), period, UPRIGHT)
        P = F @ P @ F.T + Q
        assert grown[0, 0] == pytest.approx(P[0, 0] - before, rel=1e-5)
        change = motion.update(every, np.array([0.01, 0.0, 0.0]), ALL_HELD)
        P[0, 0] += LEAST_VARIANCE
        gain = P @ H.T / (H @ P @ H.T + R)
        # by the shift, which is gain times innovation
        assert change[0] == pytest.approx(0.01 * gain[1, 0] / gain[0, 0], rel=1e-5)
        assert change[3] == pytest.approx(0.01 * gain[2, 0] / gain[0, 0], rel=1e-5)
        P = P - gain @ H @ P
    np.testing.assert_allclose(motion.covariance[0::3, 0::3], P, rtol=1e-4, atol=1e-12)


def test_a_bias_is_found_and_leaves_no_error_behind():
    """A body at rest that turns, while its accelerometer says that it is pushed to its left.

    Taken as noise of the velocity, the bias left the estimate behind by centimetres, to the left.
    """
    config, period, bias = EstimateConfig(), 0.1, np.array([0.0, 0.04, 0.0])
    motion = MotionFilter(config)
    position, velocity, found = np.zeros(3), np.zeros(3), np.zeros(3)
    R = 5e-4**2
    for step in range(300):
        axes = turned(0.05 * step)
        before, velocity = velocity, velocity + period * axes @ (bias - found)
        position = position + 0.5 * period * (before + velocity)
        motion.predict(np.zeros(3), period, axes)
        weight = motion.weight(R)[:3, :3]
        shift = np.linalg.solve(np.eye(3) + weight, -position)  # the truth stays at the origin
        change = motion.update(np.diag([1 / R, 1 / R, 1 / R, 1.0]), shift, ALL_HELD)
        position = position + shift
        velocity, found = velocity + change[:3], found + change[3:]
    assert np.abs(found - bias).max() < 0.002
    assert np.abs(position).max() < 5e-5
    sigma = np.sqrt(np.diag(motion.covariance))[6:]
    assert (sigma < 0.2 * config.accelerometer_bias).all()


def walls(angle):
    """Information of a sweep in a tunnel along x, and its axis, which it finds an angle off."""
    axis = np.array([np.cos(angle), 0.0, np.sin(angle)])
    held = np.eye(3) - np.outer(axis, axis)
    information = np.zeros((4, 4))
    information[:3, :3], information[3, 3] = 1e7 * held, 1.0
    return information, axis[None]


def test_what_a_tunnel_does_not_hold_stays_as_uncertain_as_without_sweeps():
    """Its axis, found a little off each time, let the walls tell the way: 6 cm for 0.36 m."""
    free, tunnel = MotionFilter(EstimateConfig()), MotionFilter(EstimateConfig())
    rng = np.random.default_rng(0)
    for _ in range(60):
        for motion in (free, tunnel):
            motion.predict(np.zeros(3), 0.1, turned(0.4))
        information, axis = walls(rng.normal(0.0, 0.03))
        assert (tunnel.update(information, np.zeros(3), axis) == 0.0).all()
    alone, stated = free.covariance, tunnel.covariance
    assert np.sqrt(stated[0, 0]) > 0.8 * np.sqrt(alone[0, 0])
    assert np.sqrt(stated[1, 1]) < 1e-3
    assert np.linalg.eigvalsh(stated).min() > -1e-12


def test_a_part_that_is_held_is_told_as_if_it_were_alone():
    """The same filter, whether a sweep says nothing along x or leaves it out."""
    whole, part = MotionFilter(EstimateConfig()), MotionFilter(EstimateConfig())
    for _ in range(30):
        for motion in (whole, part):
            motion.predict(np.zeros(3), 0.1, UPRIGHT)
        shift = np.array([0.0, 1e-3, 0.0])
        information, axis = walls(0.0)
        changes = [
            whole.update(information, shift, ALL_HELD),
            part.update(information, shift, axis),
        ]
        np.testing.assert_allclose(*changes, rtol=5e-3, atol=1e-9)
    np.testing.assert_allclose(whole.covariance, part.covariance, rtol=1e-2, atol=1e-9)


def test_what_is_known_of_the_bias_bounds_the_drift_without_sweeps():
    """Half the bias times the square of the time, at the start; less once sweeps determine it."""
    drifts = []
    for sweeps in (0, 100):
        motion = MotionFilter(Biased())
        for _ in range(sweeps):
            motion.predict(np.zeros(3), 0.1, UPRIGHT)
            motion.update(np.diag([1e6, 1e6, 1e6, 1.0]), np.zeros(3), ALL_HELD)
        for _ in range(100):
            motion.predict(np.zeros(3), 0.1, UPRIGHT)
        drifts.append(np.sqrt(motion.covariance[0, 0]))
    assert drifts[0] == pytest.approx(0.5 * 0.1 * 10.0**2, rel=0.05)
    assert drifts[1] < 0.2 * drifts[0]


def test_a_prediction_by_feet_counts_by_their_share_of_the_step():
    config = SteadyLegs(motion_share=0.1)
    motion = MotionFilter(config)
    motion.predict(np.array([0.05, 0.0, 0.0]), 0.1, None)
    weight = motion.weight(0.005**2)
    assert weight[0, 0] == pytest.approx(1.0, rel=1e-3)
    assert weight[1, 1] > 1e4
    change = motion.update(np.diag([4e4, 0.0, 0.0, 0.0]), np.array([0.01, 0.0, 0.0]), ALL_HELD)
    assert (change == 0.0).all()
    assert motion.weight(0.005**2)[0, 0] == pytest.approx(2.0, rel=1e-3)


def test_the_feet_are_off_by_one_error_for_a_while():
    """Ten measurements in 0.1 s at 0.02 m/s are 2 mm, not a third of it."""
    motion = MotionFilter(EstimateConfig())
    for _ in range(10):
        motion.predict(np.zeros(3), 0.01, None)
    assert np.sqrt(motion.covariance[2, 2]) == pytest.approx(0.002, rel=0.01)


def test_it_continues_from_its_state():
    motion, other = (MotionFilter(EstimateConfig()) for _ in range(2))
    motion.predict(np.array([0.05, 0.01, 0.0]), 0.01, turned(0.3))
    motion.update(np.diag([1e4, 1e5, 1e4, 1e6]), np.array([0.01, 0.0, 0.0]), ALL_HELD)
    other.restore(motion.state())
    for one in (motion, other):
        one.predict(np.array([0.05, 0.01, 0.0]), 0.01, turned(0.4))
    for name, array in motion.state().items():
        np.testing.assert_array_equal(array, other.state()[name])
