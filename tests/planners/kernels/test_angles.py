import math

import numpy as np
import pytest

from wayproof.planners.kernels import angles
from wayproof.planners.kernels.angles import (
    acceleration_limited,
    edge_headings,
    rate_limited,
    wrap,
    yaw_of_direction,
)


def test_headings_equal_the_library_and_python():
    rng = np.random.default_rng(0)
    axes = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (1.0, 1.0), (0.0, 0.0)]
    for x, y in [*axes, *rng.normal(size=(200, 2)).tolist()]:
        assert yaw_of_direction(x, y) == pytest.approx(math.atan2(y, x), abs=1e-12)
        assert yaw_of_direction.py_func(x, y) == yaw_of_direction(x, y)
    for angle in rng.uniform(-20.0, 20.0, 50):
        assert wrap(angle) == wrap.py_func(angle)
        assert math.cos(wrap(angle)) == pytest.approx(math.cos(angle))
        assert -math.pi <= wrap(angle) < math.pi


def test_steep_edges_keep_the_heading_and_turns_are_not_counted_twice():
    tangents = np.array([[0, 0, 1], [0, 1, 0], [-1, 0.01, 0], [-1, -0.01, 0], [0, 0, -1.0]])
    expected = [0.3, math.pi / 2, math.pi - 0.01, math.pi + 0.01, math.pi + 0.01]
    headings = edge_headings(tangents, 0.3)
    assert headings == pytest.approx(expected, abs=1e-4)
    assert edge_headings.py_func(tangents, 0.3).tobytes() == headings.tobytes()
    targets = np.array([0.05, 1.0, 1.0, -1.0])
    turned = rate_limited(targets, 0.0, 0.1)
    assert turned == pytest.approx([0.0, 0.05, 0.15, 0.25, 0.15])
    assert rate_limited.py_func(targets, 0.0, 0.1).tobytes() == turned.tobytes()


def there_and_back(seed):
    """Headings of a path that bends one way and back, and stays there, rad."""
    rng = np.random.default_rng(seed)
    corners = np.cumsum(rng.uniform(-1.3, 1.3, 5))
    return np.repeat(corners, rng.integers(1, 60, 5)).tolist() + [corners[-1]] * 900


@pytest.mark.parametrize("seed", range(8))
def test_headings_change_their_rate_by_no_more_than_the_limit(seed):
    targets = np.array(there_and_back(seed))
    largest_step, largest_change, rate = 0.015, 4e-4, 0.01
    headings = acceleration_limited(targets, 0.2, rate, largest_step, largest_change)
    interpreted = acceleration_limited.py_func(targets, 0.2, rate, largest_step, largest_change)
    assert interpreted.tobytes() == headings.tobytes()
    steps = np.diff(headings, prepend=0.2 - rate)
    assert headings[0] == 0.2
    assert np.abs(steps).max() <= largest_step + 1e-12
    assert np.abs(np.diff(steps)).max() <= largest_change + 1e-12
    assert headings[-1] == pytest.approx(targets[-1], abs=1e-3)
    overshoot = np.abs(headings[-200:] - targets[-1]).max()
    assert overshoot < 0.02


def test_a_heading_that_turns_evenly_is_followed_without_a_lag():
    targets = 0.01 * np.arange(1.0, 400.0)
    headings = acceleration_limited(targets, 0.0, 0.0, 0.015, 4e-4)
    assert headings[-1] == pytest.approx(targets[-1], abs=1e-3)


def test_directions_equal_the_library_and_python():
    for angle in np.random.default_rng(0).uniform(-20.0, 20.0, 200):
        found = angles.cosine_sine(angle)
        assert found == pytest.approx((math.cos(angle), math.sin(angle)), abs=1e-13)
        assert angles.cosine_sine.py_func(angle) == found
