import numpy as np
import pytest

from wayproof.harness.recordings.track import RecordedTrack, slerp

HALF = np.sqrt(0.5)
UNTURNED, LEFT = [1.0, 0.0, 0.0, 0.0], [HALF, 0.0, 0.0, HALF]


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
