"""Soak of the lidar's pose."""

import numpy as np

from tests.tools.soak.estimators import config_of, soak_estimators


def test_a_lost_pose_is_repeated():
    repeated = soak_estimators(1, 0, print, first=14)  # a drone in the middle of a tunnel
    assert repeated.failures == []
    assert (repeated.count, repeated.replayed, repeated.forked_alike) == (1, 1, repeated.forked)
    assert repeated.decisions > 7


def test_the_worlds_take_turns_and_the_rest_follows_from_the_seed():
    drawn = [config_of(number, np.random.default_rng([0, number])) for number in range(16)]
    assert len({(one.world, one.robot) for one in drawn}) == 16
    assert drawn[3] == config_of(3, np.random.default_rng([0, 3]))
    assert all(one.estimate.kind == "lidar" for one in drawn)
