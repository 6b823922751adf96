"""Kalman filter of the motion between sweeps, against filters written out by hand."""

import numpy as np
import pytest

from wayproof.harness.estimator_config import EstimateConfig
from wayproof.harness.estimators.matrices import inverse
from wayproof.harness.estimators.motion_filter import LEAST_VARIANCE, MotionFilter


def test_the_inverse_is_numpys():
    rng = np.random.default_rng(0)
    root = rng.standard_normal((4, 7))
    np.testing.assert_allclose(inverse(root @ root.T), np.linalg.inv(root @ root.T), rtol=1e-9)


def test_position_and_velocity_are_those_of_a_textbook_filter():
    """One axis of it: state (x, v), F = [[1, T], [0, 1]], a position measured at each sweep."""
    config = EstimateConfig(accelerometer_bias=0.5, accelerometer_noise=0.0)
    motion, period = MotionFilter(config, sweep_period=0.1), 0.1
    P, F = np.diag([LEAST_VARIANCE, 0.0]), np.array([[1.0, period], [0.0, 1.0]])
    Q = np.diag([0.0, 0.5**2 * period * period])
    H, R = np.array([[1.0, 0.0]]), 0.01**2
    for _ in range(20):
        motion.predict(np.zeros(3), period, inertial=True)
        P = F @ P @ F.T + Q
        information = np.diag([1 / R, 1 / R, 1 / R, 1.0])
        velocity = motion.update(information, np.array([0.01, 0.0, 0.0]))
        P[0, 0] += LEAST_VARIANCE
        gain = P @ H.T / (H @ P @ H.T + R)
        expected = 0.01 * gain[1, 0] / gain[0, 0]  # by the shift, which is gain times innovation
        assert velocity[0] == pytest.approx(expected, rel=1e-6)
        P = P - gain @ H @ P
    assert motion.velocity[0, 0] == pytest.approx(P[1, 1], rel=1e-6)
    assert 0.0 < motion.velocity_sigma < 0.5


def test_a_prediction_by_feet_counts_by_their_share_of_the_step():
    config = EstimateConfig(motion_share=0.1, leg_noise=0.0)
    motion = MotionFilter(config, sweep_period=0.1)
    motion.predict(np.array([0.05, 0.0, 0.0]), 0.1, inertial=False)
    weight = motion.weight(0.005**2)
    assert weight[0, 0] == pytest.approx(1.0, rel=1e-3)
    assert weight[1, 1] > 1e4
    assert (motion.update(np.diag([4e4, 0.0, 0.0, 0.0]), np.array([0.01, 0.0, 0.0])) == 0.0).all()
    assert motion.weight(0.005**2)[0, 0] == pytest.approx(2.0, rel=1e-3)


def test_it_continues_from_its_state():
    motion, other = (MotionFilter(EstimateConfig(), 0.1) for _ in range(2))
    motion.predict(np.array([0.05, 0.01, 0.0]), 0.01, inertial=True)
    motion.update(np.diag([1e4, 1e5, 1e4, 1e6]), np.array([0.01, 0.0, 0.0]))
    other.restore(motion.state())
    for one in (motion, other):
        one.predict(np.array([0.05, 0.01, 0.0]), 0.01, inertial=True)
    for name, array in motion.state().items():
        np.testing.assert_array_equal(array, other.state()[name])
