"""Points along paths."""

import numpy as np
import pytest

from wayproof.harness.log.paths import densely, refined, speed_at
from wayproof.harness.schema import wayproof_pb2 as pb


def test_points_lie_densely():
    path = densely(np.array([[0.0, 0, 0], [1.0, 0, 0], [1.0, 0.5, 0]]), 0.3)
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() <= 0.3
    assert path[[0, 4, -1]].tolist() == [[0, 0, 0], [1, 0, 0], [1, 0.5, 0]]


def test_a_thinned_path_gets_the_corners_of_the_path_along_it():
    whole = np.array([[0.05 * n, 0.0, 0.0] for n in range(20)] + [[0.95, 0.5, 0.0]])
    beyond = np.array([[0.95, 1.0, 0.0], [2.0, 1.0, 0.0]])
    thinned = np.concatenate([whole[[0, 5, 10, 15]], beyond])
    np.testing.assert_array_equal(refined(thinned, whole), np.concatenate([whole, beyond]))
    np.testing.assert_array_equal(refined(thinned[:4], whole), whole)
    elsewhere = thinned + np.array([0.0, 0.1, 0.0])
    np.testing.assert_array_equal(refined(elsewhere, whole), elsewhere)
    assert len(refined(np.empty((0, 3)), whole)) == 0


def test_the_speed_at_a_joint_is_that_of_the_moment_not_a_mean_over_the_next_period():
    """From rest at 2 m/s^2: 0.2 m/s after 0.1 s, and 0.3 m/s on average over the next 0.1 s."""
    times = 0.1 * np.arange(5)
    speeding_up = pb.Trajectory(arc_length=times**2, sample_period_s=0.1)
    found = [speed_at(speeding_up, n * 10**8) for n in range(4)]
    np.testing.assert_allclose(found, 2.0 * times[:4], atol=1e-9)
    assert speed_at(speeding_up, 150_000_000) == pytest.approx(0.3)
    even = pb.Trajectory(arc_length=0.3 * times, sample_period_s=0.1)
    assert speed_at(even, 0) == speed_at(even, 100_000_000) == pytest.approx(0.3)
    assert speed_at(even, 10**9) == 0.0  # at rest beyond its end
