import math

import mujoco
import numpy as np
import pytest

from wayproof.models.poses import Trail, rotation_matrices


def turned(angle):
    return np.array([math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)])


def trail():
    positions = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.0]])
    quaternions = np.stack([turned(0.0), turned(0.2), -turned(0.4)])
    return Trail(positions, quaternions, 0.1)


@pytest.mark.parametrize(
    ("age", "position", "heading"),
    [
        (0.0, [1.0, 2.0, 0.0], 0.4),
        (0.05, [1.0, 1.0, 0.0], 0.3),
        (0.1, [1.0, 0.0, 0.0], 0.2),
        (0.15, [0.5, 0.0, 0.0], 0.1),
        (0.2, [0.0, 0.0, 0.0], 0.0),
        (9.0, [0.0, 0.0, 0.0], 0.0),
    ],
)
def test_poses_between_samples_by_hand(age, position, heading):
    positions, rotations = trail().before_now(np.array([age]))
    np.testing.assert_allclose(positions[0], position, atol=1e-12)
    assert math.atan2(rotations[0, 1, 0], rotations[0, 0, 0]) == pytest.approx(heading, abs=1e-9)


def test_one_pose_is_a_body_at_rest():
    still = Trail(np.array([[1.0, 2.0, 3.0]]), turned(0.5)[None], 0.01)
    positions, rotations = still.before_now(np.linspace(0.1, 0.0, 7))
    assert (positions == [1.0, 2.0, 3.0]).all()
    assert (rotations == rotations[0]).all()


def test_every_keeps_the_pose_that_is_now():
    sparse = trail().every(2)
    assert sparse.period == pytest.approx(0.2)
    assert sparse.positions.tolist() == [[0.0, 0.0, 0.0], [1.0, 2.0, 0.0]]


def test_rotations_are_mujocos():
    rng = np.random.default_rng(0)
    quaternions = rng.normal(size=(50, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    R = np.empty(9)
    for quaternion, rotation in zip(quaternions, rotation_matrices(quaternions), strict=True):
        mujoco.mju_quat2Mat(R, quaternion)
        np.testing.assert_allclose(rotation.ravel(), R, atol=1e-15)


@pytest.mark.parametrize(
    ("positions", "quaternions", "period", "said"),
    [
        (np.empty((0, 3)), np.empty((0, 4)), 0.1, "k >= 1"),
        (np.zeros((2, 3)), np.zeros((1, 4)), 0.1, "expected"),
        (np.zeros((1, 3)), np.zeros((1, 4)), 0.0, "period of 0 s"),
    ],
)
def test_what_is_no_trail_is_refused(positions, quaternions, period, said):
    with pytest.raises(ValueError, match=said):
        Trail(positions, quaternions, period)
