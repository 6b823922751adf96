from collections import Counter

import numpy as np
import pytest

from wayproof.harness.errors import InputError
from wayproof.harness.recordings.options import RecordingOptions
from wayproof.harness.recordings.poses import StampedPoses, sound, track_of
from wayproof.harness.recordings.transform import Transform, compose, inverse, planar, rotate

UNTURNED = [1.0, 0.0, 0.0, 0.0]


def poses(*rows):
    stamps, positions, quaternions = zip(*rows, strict=True)
    return StampedPoses(
        np.array(stamps, np.int64), np.array(positions, float), np.array(quaternions, float)
    )


def test_each_kind_of_wrong_pose_is_counted():
    here = [0.0, 0.0, 0.0]
    rows = poses(
        (0, here, UNTURNED),
        (1, [np.nan, 0, 0], UNTURNED),
        (2, [1e6, 0, 0], UNTURNED),
        (3, here, [0, 0, 0, 0]),
        (4, here, [np.nan, 0, 0, 0]),
        (5, here, [1.01, 0, 0, 0]),
        (5, here, UNTURNED),
        (4, here, UNTURNED),
        (6, here, UNTURNED),
    )
    faults = Counter()
    kept = sound(rows, faults)
    assert kept.stamps_ns.tolist() in ([0, 5, 6], [0, 4, 6])
    assert (kept.quaternions == UNTURNED).all()
    assert +faults == {
        "pose: not finite": 2,
        "pose: beyond 100000 m": 1,
        "pose: quaternion far from unit length": 1,
        "pose: quaternion normalised": 1,
        "pose: repeated stamp": 1,
        "pose: stamp out of order": 1,
    }


def test_a_unit_quaternion_keeps_its_bits_when_it_is_read_again():
    rng = np.random.default_rng(1)
    rough = rng.normal(size=(500, 4))
    rough /= np.sqrt(np.square(rough).sum(axis=1))[:, None] * rng.uniform(0.99, 1.01, (500, 1))
    first = sound(StampedPoses(np.arange(500), np.zeros((500, 3)), rough), Counter())
    second = sound(first, Counter())
    assert (first.quaternions == second.quaternions).all()
    assert np.abs(np.square(first.quaternions).sum(axis=1) - 1.0).max() < 1e-15


def test_transforms_compose_and_invert():
    positions, quaternions = planar(np.array([[1.0, 2.0, np.pi / 2]]))
    T_a_b = Transform(positions[0], quaternions[0])
    T_b_c = Transform(np.array([3.0, 0.0, 1.0]), np.array([0.6, 0.8, 0.0, 0.0]))
    point = np.array([0.1, 0.2, 0.3])
    in_b = T_b_c.position + rotate(T_b_c.quaternion, point)
    in_a = T_a_b.position + rotate(T_a_b.quaternion, in_b)
    T_a_c = compose(T_a_b, T_b_c)
    np.testing.assert_allclose(T_a_c.position + rotate(T_a_c.quaternion, point), in_a, atol=1e-15)
    np.testing.assert_allclose(T_a_c.position, [1.0, 5.0, 1.0], atol=1e-15)
    nothing = compose(T_a_c, inverse(T_a_c))
    np.testing.assert_allclose(nothing.position, 0.0, atol=1e-14)
    np.testing.assert_allclose(nothing.quaternion, UNTURNED, atol=1e-15)


def test_no_sound_pose_is_refused_in_a_line():
    wrong = poses((0, [np.nan, 0, 0], UNTURNED))
    with pytest.raises(InputError, match="no pose of 1 from odom can be used"):
        track_of(wrong, "odom", RecordingOptions(), Counter())
