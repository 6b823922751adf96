"""How far wheels are astray, on steps that are worked out by hand."""

import math

import numpy as np
import pytest

from wayproof.harness.estimator_config import EstimateConfig
from wayproof.harness.estimators.slip import FADING, NEWS, Slip
from wayproof.harness.estimators.stated_covariance import StatedCovariance


class Unwalked(EstimateConfig):
    motion_walk = 0.0


CONFIG = Unwalked(motion_share=0.1)
AHEAD = np.array([0.1, 0.0, 0.0])


def seen(slip, correction, heading=0.0):
    slip.predict(AHEAD, 0.2, 0.0)
    slip.correct(np.array([*correction[:2], 0.0, correction[2]]), heading)


def test_what_wheels_err_as_they_are_said_to_is_no_slip():
    slip = Slip(CONFIG)
    for _ in range(20):
        seen(slip, (0.03, -0.02, 0.02))  # below 3 deviations of 0.01 and 0.02 m, and of 0.01 rad
    assert (slip.mean == 0.0).all()
    assert (slip.scatter == 0.0).all()
    slip.predict(AHEAD, 0.2, 0.01**2)
    assert slip.reach == pytest.approx((0.02, 0.02))


def test_an_error_that_stays_adds_up_in_the_axes_of_the_body():
    slip = Slip(CONFIG)
    for number in range(40):  # 1 m/s backwards, whichever way the robot faces
        heading = 0.1 * number
        seen(slip, (-0.2 * math.cos(heading), -0.2 * math.sin(heading), 0.0), heading)
    np.testing.assert_allclose(slip.mean, [-1.0, 0.0, 0.0], atol=1e-5)
    np.testing.assert_allclose(slip.scatter, 0.0, atol=1e-4)
    total = sum(slip.predict(AHEAD, 0.2, 0.0)[0][0] for _ in range(5))
    assert total == pytest.approx(0.2 * sum(FADING**n for n in range(5)), rel=1e-4)
    assert slip.reach[0] == pytest.approx(2.0 * math.hypot(total, 0.05), rel=1e-3)


def test_an_error_that_comes_once_scatters_and_is_forgotten():
    slip = Slip(CONFIG)
    seen(slip, (0.2, 0.0, 0.1))
    np.testing.assert_allclose(slip.mean, [NEWS, 0.0, 0.5 * NEWS])
    np.testing.assert_allclose(slip.scatter, [NEWS, 0.25 * NEWS])
    for _ in range(60):
        seen(slip, (0.0, 0.0, 0.0))
    assert np.abs(slip.mean).max() < 1e-8
    assert slip.scatter.max() < 1e-8


def test_what_it_says_is_stated_until_a_scan_holds_the_pose():
    slip, covariance = Slip(CONFIG), StatedCovariance(CONFIG)
    for _ in range(40):
        seen(slip, (-0.2, 0.0, 0.1))
    for _ in range(10):
        covariance.predict(np.zeros(3), 0.2, None, 0.0, slip.predict(np.zeros(3), 0.2, 0.0))
    along = 0.2 * sum(FADING**n for n in range(10))
    pose = np.sqrt(np.diag(covariance.pose))
    assert pose[:2] == pytest.approx([along, along], rel=1e-2)
    assert pose[2] < 0.01  # wheels stay on the ground
    assert pose[3] == pytest.approx(0.5 * along, rel=1e-2)
    again = StatedCovariance(CONFIG)
    again.restore(covariance.state())
    assert np.array_equal(again.pose, covariance.pose)


def test_it_goes_on_from_its_state():
    slip, other = Slip(CONFIG), Slip(CONFIG)
    seen(slip, (0.2, 0.1, 0.1))
    slip.predict(AHEAD, 0.2, 0.001)
    other.restore(slip.state())
    for one in (slip, other):
        one.predict(AHEAD, 0.3, 0.002)
    assert slip.reach == other.reach
    for one in (slip, other):
        one.correct(np.array([0.4, 0.0, 0.0, 0.2]), 1.0)
    for name, value in slip.state().items():
        assert np.array_equal(value, other.state()[name])
