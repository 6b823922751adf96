"""Stamps put in order, poses checked and made a track, and the transforms between frames."""

from collections import Counter

import numpy as np
import pytest

from wayproof.harness.errors import InputError
from wayproof.harness.recordings.options import RecordingOptions
from wayproof.harness.recordings.order import in_order, set_backs
from wayproof.harness.recordings.poses import StampedPoses, sound, track_of
from wayproof.harness.recordings.track import RecordedTrack, slerp
from wayproof.harness.recordings.transform import (
    Transform,
    compose,
    inverse,
    planar,
    quaternion_of,
    rotate,
)
from wayproof.models.poses import rotation_matrices

HALF = np.sqrt(0.5)
UNTURNED, LEFT = [1.0, 0.0, 0.0, 0.0], [HALF, 0.0, 0.0, HALF]


@pytest.mark.parametrize(
    ("stamps", "kept"),
    [
        ([], []),
        ([5], [5]),
        ([1, 2, 3], [1, 2, 3]),
        ([1, 2, 2, 3], [1, 2, 3]),
        ([1, 9, 2, 3, 4], [1, 2, 3, 4]),  # one far ahead loses itself alone
        ([5, 6, 0, 7, 8], [5, 6, 7, 8]),  # and one far behind
        ([7, 8, 1, 2, 3, 4], [1, 2, 3, 4]),  # a clock set back loses the shorter side
    ],
)
def test_a_longest_increasing_part_is_kept(stamps, kept):
    stamps = np.array(stamps, np.int64)
    assert stamps[in_order(stamps)].tolist() == kept


def test_against_every_choice_of_short_sequences():
    rng = np.random.default_rng(0)
    for _ in range(200):
        stamps = rng.integers(0, 8, 8)
        chosen = stamps[in_order(stamps)]
        assert (np.diff(chosen) > 0).all()
        parts = (stamps[[k for k in range(8) if mask >> k & 1]] for mask in range(256))
        assert len(chosen) == max(len(part) for part in parts if (np.diff(part) > 0).all())


@pytest.mark.parametrize("back", [0, 10, 40, 200])
@pytest.mark.parametrize("exchanged", [0, 3, 8])
def test_a_clock_set_back_is_told_from_an_exchanged_order(back, exchanged):
    rng = np.random.default_rng(0)
    for _ in range(20):
        clock = 1000 * np.concatenate([np.arange(200), np.arange(200, 400) - back])
        clock += rng.integers(-200, 200, 400)
        sent = np.argsort(np.arange(400) + rng.uniform(0, exchanged, 400), kind="stable")
        found = set_backs(clock[sent])
        assert len(found) == (back > 0)
        assert all(abs(place - 200) <= exchanged for place in found)


def test_two_who_publish_the_same_are_no_clock_set_back():
    stamps = np.stack([np.arange(100), np.arange(100) - 7], axis=1).ravel()
    assert set_backs(stamps) == []


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


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ([(0, [np.nan, 0, 0], UNTURNED)], "no pose of 1 from odom can be used"),
        (
            [(-(2**61), [0.0] * 3, UNTURNED), (2**61, [0.0] * 3, UNTURNED)],
            "odom span over 100 years",
        ),
    ],
)
def test_poses_that_make_no_track_are_refused_in_a_line(rows, said):
    with pytest.raises(InputError, match=said):
        track_of(poses(*rows), "odom", RecordingOptions(), Counter())


def test_a_span_just_below_the_longest_is_a_track():
    ends = poses((-(2**61), [0.0] * 3, UNTURNED), (2**61 - 1, [0.0] * 3, UNTURNED))
    track, start = track_of(ends, "odom", RecordingOptions(), Counter())
    assert (start, track.times_ns.tolist()) == (-(2**61), [0, 2**62 - 1])


@pytest.mark.parametrize("axis", range(4))
def test_a_rotation_comes_back_whichever_component_is_greatest(axis):
    rng = np.random.default_rng(axis)
    quaternions = rng.normal(scale=0.2, size=(20, 4))
    quaternions[:, axis] += 1.0
    quaternions /= np.sqrt(np.square(quaternions).sum(axis=1))[:, None]
    for quaternion, R in zip(quaternions, rotation_matrices(quaternions), strict=True):
        found = quaternion_of(R)
        np.testing.assert_allclose(found * np.sign(found @ quaternion), quaternion, atol=1e-14)


def track(times, max_gap_ns=1000):
    count = len(times)
    positions = np.arange(3.0 * count).reshape(count, 3)
    return RecordedTrack(np.array(times), positions, np.tile(UNTURNED, (count, 1)), "t", max_gap_ns)


def test_samples_are_returned_bit_by_bit_and_between_them_it_is_linear():
    way = track([0, 100, 300])
    positions, quaternions = way.at(np.array([0, 100, 200, 300]))
    assert positions.tolist() == [[0, 1, 2], [3, 4, 5], [4.5, 5.5, 6.5], [6, 7, 8]]
    assert (quaternions == UNTURNED).all()


def test_orientations_turn_at_constant_speed_the_short_way():
    thirds = slerp(np.array([UNTURNED] * 2), np.array([LEFT, np.negative(LEFT)]), np.full(2, 1 / 3))
    expected = [np.cos(np.pi / 12), 0.0, 0.0, np.sin(np.pi / 12)]  # 30 of 90 degrees
    np.testing.assert_allclose(thirds, [expected, expected], atol=1e-15)


def test_a_gap_is_not_covered_but_its_ends_are():
    way = track([0, 100, 2000], max_gap_ns=1000)
    times = np.array([-1, 0, 50, 100, 101, 1999, 2000, 2001])
    assert way.covers(times).tolist() == [False, True, True, True, False, False, True, False]


def test_a_gap_lies_in_an_interval_that_shares_some_time_with_it():
    one = track([0, 500, 2000, 2500])
    assert [one.has_gap(*ends) for ends in ((0, 500), (2000, 2500), (500, 500))] == [False] * 3
    assert [one.has_gap(*ends) for ends in ((0, 2500), (499, 501), (500, 2000))] == [True] * 3


def test_a_track_of_one_pose_covers_its_stamp():
    assert track([7]).covers(np.array([6, 7, 8])).tolist() == [False, True, False]
    assert track([7]).at(np.array([7]))[0].tolist() == [[0, 1, 2]]


@pytest.mark.parametrize("times", [[], [0, 0], [1, 0]])
def test_times_that_do_not_increase_are_refused(times):
    with pytest.raises(ValueError, match="track: got"):
        track(times)
