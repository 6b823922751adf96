"""Angles, yaw and polyline lengths."""

import math

import numpy as np
import pytest

from wayproof.harness.geometry import atan2_rounded, polyline_length, wrap_angle, yaw_of_quaternion

TURN = 2.0 * math.pi


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [(0.0, 0.0), (math.pi, -math.pi), (-math.pi, -math.pi), (4.0, 4.0 - TURN), (-7.0, TURN - 7.0)],
)
def test_an_angle_is_wrapped_to_half_a_turn_either_way(angle, wrapped):
    assert wrap_angle(angle) == pytest.approx(wrapped, abs=1e-12)


def test_the_angle_of_a_direction_takes_y_first_and_has_whole_nanoradians():
    assert atan2_rounded(1.0, 0.0) == pytest.approx(0.5 * math.pi, abs=1e-9)
    for angle in np.linspace(-3.1, 3.1, 50):
        found = atan2_rounded(math.sin(angle), math.cos(angle))
        assert found == pytest.approx(angle, abs=1e-9)
        assert found == round(found, 9)


def test_the_yaw_of_a_quaternion_is_the_turn_about_z():
    for yaw in (-3.0, -0.3, 0.0, 2.0):
        upright = np.array([math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)])
        assert yaw_of_quaternion(upright) == pytest.approx(yaw, abs=1e-9)
    pitched = np.array([math.cos(0.1), 0.0, math.sin(0.1), 0.0])
    assert yaw_of_quaternion(pitched) == 0.0


def test_the_length_of_a_polyline_is_that_of_its_edges():
    points = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [3.0, 4.0, 2.0]])
    assert polyline_length(points) == 7.0
    assert polyline_length(points[:1]) == 0.0
    assert polyline_length(points[:0]) == 0.0
