"""Tensors of a policy, on hand-made observations."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.harness.interface.stacks.hand_made import observation, task
from wayproof.harness.interface.policy_tensors import (
    ACTION,
    BEARINGS,
    OBSERVATION,
    SCAN_RANGE_M,
    PolicyObserver,
    velocity_of,
)


def scan(points, robot="quadruped", **options):
    given = task(robot)
    tensors = PolicyObserver(given).tensors(observation(given, points, **options))
    for name, space in OBSERVATION.items():
        assert tensors[name].shape == space.shape
        assert tensors[name].dtype == np.float32
        assert ((tensors[name] >= space.low) & (tensors[name] <= space.high)).all()
    return tensors["scan"]


def test_bearings_are_those_of_the_arc_tangent():
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(-9.0, 9.0, (500, 2)), np.full(500, 0.2)])
    distances = np.hypot(points[:, 0], points[:, 1])
    bins = np.floor(np.arctan2(points[:, 1], points[:, 0]) % math.tau / math.tau * BEARINGS)
    seen = scan(points)
    for bearing in range(BEARINGS):
        near = distances[bins == bearing].min(initial=SCAN_RANGE_M)
        assert seen[bearing] == pytest.approx(near, abs=2e-3)


def test_the_scan_turns_with_the_body():
    ahead = scan([(2.0, 0.1, 0.2)])
    turned = scan([(-0.1, 2.0, 0.2)], heading=math.pi / 2)
    assert np.flatnonzero(ahead < SCAN_RANGE_M).tolist() == [0]
    assert ahead == pytest.approx(turned, abs=2e-3)


@pytest.mark.parametrize(
    ("robot", "height", "seen"),
    [
        ("quadruped", 0.02, False),  # floor, and what it steps over
        ("quadruped", 0.1, True),
        ("quadruped", 0.6, False),  # above its back
        ("drone", 1.0, True),
        ("drone", 0.5, False),
        ("drone", 1.5, False),
    ],
)
def test_only_returns_at_a_height_that_the_body_takes_count(robot, height, seen):
    assert (scan([(1.0, 0.05, height)], robot) < SCAN_RANGE_M).any() == seen


def test_the_nearest_return_of_a_bearing_counts_and_none_is_the_range():
    assert scan([]).tolist() == [SCAN_RANGE_M] * BEARINGS
    seen = scan([(3.0, 0.1, 0.2), (1.5, 0.05, 0.2), (12.0, 3.0, 0.2)])
    assert seen[0] == pytest.approx(1.5, abs=2e-3)
    assert (seen[1:] == SCAN_RANGE_M).all()


def test_goal_and_velocities_are_in_the_frame_of_the_body():
    given = task(goal=(5.0, 2.0))
    seen = observation(given, heading=math.pi / 2, speed=1.0)
    seen = replace(
        seen, position=np.array([1.0, 0.0, 0.3]), yaw_rate=0.4, position_sigma=0.2,
        heading_sigma=0.1,
    )  # fmt: skip
    tensors = PolicyObserver(given).tensors(seen)
    assert tensors["goal"] == pytest.approx([2.0, -4.0, 0.0], abs=1e-6)
    assert tensors["velocity"] == pytest.approx([1.0, 0.0, 0.0, 0.4], abs=1e-6)
    assert tensors["reference"] == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=1e-6)
    assert tensors["sigma"] == pytest.approx([0.2, 0.1])


def test_what_is_beyond_the_bounds_is_clipped():
    given = task(goal=(5000.0, 0.0))
    seen = replace(observation(given), position_sigma=1e6)
    tensors = PolicyObserver(given).tensors(seen)
    assert tensors["goal"][0] == 100.0
    assert tensors["sigma"][0] == 100.0


def test_an_action_is_a_share_of_the_limits():
    mission = task("drone").mission
    velocity = velocity_of(np.array([0.5, -0.25, 0.1, -2.0]), mission)
    assert (velocity.forward, velocity.left, velocity.up) == (1.0, -0.5, 0.2)
    assert velocity.yaw_rate == -1.0
    walking = velocity_of(np.array([1.0, 0.04, 1.0, -0.04]), task().mission)
    assert (walking.forward, walking.left, walking.up, walking.yaw_rate) == (1.0, 0.0, 0.0, 0.0)
    assert math.isnan(velocity_of(np.array([np.nan, 0.0, 0.0, 0.0]), mission).forward)
    assert ACTION.shape == (4,)
