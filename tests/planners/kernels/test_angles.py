import math

import numpy as np
import pytest

from wayproof.planners.kernels import angles
from wayproof.planners.kernels.angles import edge_headings, rate_limited, wrap, yaw_of_direction


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


def test_directions_equal_the_library_and_python():
    for angle in np.random.default_rng(0).uniform(-20.0, 20.0, 200):
        found = angles.cosine_sine(angle)
        assert found == pytest.approx((math.cos(angle), math.sin(angle)), abs=1e-13)
        assert angles.cosine_sine.py_func(angle) == found
