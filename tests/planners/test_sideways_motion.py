"""Bodies that turn into their path while they move along it."""

from dataclasses import replace

import numpy as np
import pytest

from tests.planners.motions import DRONE, LIMITS, LINE, sampled
from wayproof.planners import PathState, Trajectory, follow_path

QUADRUPED = LIMITS[0]
SIDEWAYS = 0.3  # m/s


def heading_errors(trajectory: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """Angles between heading and motion, rad, and speeds, m/s, where it moves."""
    samples = sampled(trajectory)
    moves = samples["speed"] > 1e-3
    velocity, heading = samples["velocity"][moves], samples["heading"][moves]
    errors = np.arctan2(velocity[:, 1], velocity[:, 0]) - heading
    return np.abs((errors + np.pi) % (2 * np.pi) - np.pi), samples["speed"][moves]


@pytest.mark.parametrize("heading", [0.0, 0.2, 1.5, np.pi, -2.5])
def test_a_body_turns_while_it_moves_sideways_no_faster_than_it_can(heading):
    state = PathState(0, 0.0, 0.0, 0.0, heading)
    turning = follow_path(LINE, state, QUADRUPED, 9.0, sideways_speed=SIDEWAYS)
    errors, speeds = heading_errors(turning)
    assert speeds[errors > 0.3].max(initial=0.0) <= SIDEWAYS + 1e-6
    assert errors[-1] < 1e-6
    assert speeds.max() == pytest.approx(QUADRUPED.speed)
    assert turning.at(round(turning.duration_s * 1e9)).position == pytest.approx(LINE[-1])
    straight = follow_path(LINE, state, QUADRUPED, 9.0)
    slower = turning.duration_s - straight.duration_s
    assert slower == 0.0 if abs(heading) < 0.25 else slower > 0.2


def test_a_body_that_moves_at_full_speed_in_any_direction_is_slowed_by_no_turn():
    angles = np.linspace(0.0, np.pi, 60)
    arc = 2.0 * np.stack([np.sin(angles), 1.0 - np.cos(angles), np.zeros(60)], axis=1)
    slow = replace(DRONE, yaw_rate=0.25)  # rad/s: of 0.5 m/s on this arc
    state = PathState(0, 0.0, 0.0, 0.0, 2.0)
    turning = follow_path(arc, state, slow, 9.0)
    assert sampled(turning)["speed"].max() == pytest.approx(0.5, rel=0.02)
    ahead = follow_path(arc, state, slow, 9.0, sideways_speed=DRONE.speed)
    assert sampled(ahead)["speed"].max() == pytest.approx(DRONE.speed, rel=0.02)
    rates = np.diff(sampled(ahead)["heading"]) / 0.002
    assert np.abs(rates).max() <= 0.25 + 1e-6


def test_a_sharp_corner_is_taken_sideways_and_the_turn_is_made_good_behind_it():
    ahead = np.arange(0.0, 3.0, 0.05)
    still, up = np.zeros_like(ahead), np.ones_like(ahead)
    first, second = np.stack([ahead, still, up], 1), np.stack([still + 3.0, ahead, up], 1)
    path = np.concatenate([first, second])
    state = PathState(0, 0.0, 0.0, 0.0, 0.0)
    aside = follow_path(path, state, QUADRUPED, 9.0, sideways_speed=SIDEWAYS)
    errors, speeds = heading_errors(aside)
    assert errors.max() > 0.5
    assert speeds[errors > 0.3].max() <= SIDEWAYS + 1e-6
    assert speeds[errors > 0.3].min() > 0.1
    assert errors[-1] < 1e-6
