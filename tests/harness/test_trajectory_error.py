"""ATE and RPE on hand-made trajectories."""

import math

import numpy as np
import pytest

from wayproof.harness.trajectory_error import Track, ate, relative_errors, rotations, rpe

LEFT = [math.cos(math.pi / 4), 0.0, 0.0, math.sin(math.pi / 4)]  # a quarter turn about z
AHEAD = [1.0, 0.0, 0.0, 0.0]


def test_a_shift_of_all_poses_is_an_absolute_error_alone():
    truth = Track(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.tile(AHEAD, (3, 1)))
    shifted = Track(truth.positions + np.array([0.3, 0.4, 0.0]), truth.quaternions)
    assert ate(shifted, truth) == pytest.approx(0.5)
    assert rpe(shifted, truth) == pytest.approx(0.0, abs=1e-15)


def test_motions_are_compared_in_the_frame_of_the_body():
    """The estimate is turned by a quarter, and so are its steps: each walked one metre ahead."""
    truth = Track(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.tile(AHEAD, (3, 1)))
    turned = Track(np.array([[0.0, 0, 0], [0, 1, 0], [0, 2, 0]]), np.tile(LEFT, (3, 1)))
    assert relative_errors(turned, truth) == pytest.approx([0.0, 0.0], abs=1e-15)
    # Without the turn of its body, the same steps go to the side: (0, 1) against (1, 0).
    sideways = Track(turned.positions, truth.quaternions)
    assert rpe(sideways, truth) == pytest.approx(math.sqrt(2.0))


def test_a_scale_of_the_quaternion_does_not_matter():
    quarter = rotations(np.array([LEFT, [2.0 * one for one in LEFT]]))
    assert quarter[0] == pytest.approx(quarter[1])
    assert quarter[0] == pytest.approx(np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]))


def test_too_few_moments_have_no_error():
    none = Track(np.zeros((0, 3)), np.zeros((0, 4)))
    one = Track(np.zeros((1, 3)), np.array([AHEAD]))
    assert ate(none, none) is None
    assert rpe(one, one) is None
