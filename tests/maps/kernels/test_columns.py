import numpy as np
import pytest

from wayproof.maps.kernels import columns as kernels


def both(kernel):
    return pytest.mark.parametrize("run", [kernel, kernel.py_func], ids=["compiled", "python"])


def draw_boxes(rng, count):
    low = rng.integers(-40, 60, (count, 3))
    return np.hstack([low, low + rng.integers(0, 40, (count, 3))])


@both(kernels.touch)
def test_boxes_that_touch_a_window(run):
    rng, nothing = np.random.default_rng(0), 0
    for _ in range(100):
        boxes = draw_boxes(rng, int(rng.integers(0, 6)))
        first, shape = rng.integers(-30, 30, 3), rng.integers(1, 40, 3)
        low, high = np.maximum(boxes[:, :3], first), np.minimum(boxes[:, 3:], first + shape)
        touches = np.all(low < high, axis=1)
        touching, found = np.empty_like(boxes), np.empty((2, 2), np.int64)
        window = tuple(first.tolist()), tuple(shape.tolist())
        count = run(boxes, *window, touching, found)
        np.testing.assert_array_equal(touching[:count], boxes[touches])
        nothing += count == 0
        if count:
            corners = (low[touches].min(axis=0) - first, high[touches].max(axis=0) - first)
            np.testing.assert_array_equal(found, np.stack(corners, axis=1)[:2])
    assert 0 < nothing < 100
