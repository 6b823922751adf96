"""The boxes and bricks that a change is told by: compiled, interpreted, and by numpy."""

import numpy as np
import pytest

from wayproof.maps.kernels import bricks, columns, update


@pytest.fixture(params=["compiled", "interpreted"])
def run(request):
    """A kernel as it is called, or the Python that it is made of."""
    return (lambda kernel: kernel) if request.param == "compiled" else (lambda k: k.py_func)


def draw_boxes(rng, count):
    low = rng.integers(-40, 60, (count, 3))
    return np.hstack([low, low + rng.integers(0, 40, (count, 3))])


def test_boxes_that_touch_a_window(run):
    rng, nothing = np.random.default_rng(0), 0
    for _ in range(100):
        boxes = draw_boxes(rng, int(rng.integers(0, 6)))
        first, shape = rng.integers(-30, 30, 3), rng.integers(1, 40, 3)
        low, high = np.maximum(boxes[:, :3], first), np.minimum(boxes[:, 3:], first + shape)
        wanted = np.all(low < high, axis=1)
        touching, found = np.empty_like(boxes), np.empty((2, 2), np.int64)
        window = tuple(first.tolist()), tuple(shape.tolist())
        count = run(columns.touch)(boxes, *window, touching, found)
        np.testing.assert_array_equal(touching[:count], boxes[wanted])
        nothing += count == 0
        if count:
            corners = (low[wanted].min(axis=0) - first, high[wanted].max(axis=0) - first)
            np.testing.assert_array_equal(found, np.stack(corners, axis=1)[:2])
    assert 0 < nothing < 100


def test_blocks_that_boxes_meet(run):
    rng = np.random.default_rng(1)
    for _ in range(100):
        boxes = draw_boxes(rng, int(rng.integers(0, 6)))
        low, size = rng.integers(-30, 30, 3), rng.integers(1, 70, 2)
        met = set()
        for box in boxes.tolist():
            cells = [range(max(box[i], low[i]), min(box[3 + i], low[i] + size[i])) for i in (0, 1)]
            met |= {(x // 16, y // 16) for x in cells[0] for y in cells[1]}
        extent = (low[:2] + size - 1) // 16 - low[:2] // 16 + 1
        touched, blocks = np.zeros(extent, np.bool_), np.empty((extent.prod(), 2), np.int64)
        window = tuple(low.tolist()), tuple(size.tolist())
        count = run(bricks.list_blocks)(boxes, *window, touched, blocks)
        listed = [tuple(block) for block in blocks[:count].tolist()]
        assert listed == sorted(set(listed))
        assert met <= set(listed)
        # What is written besides is written as it is: only at the window's edge, beside a box.
        edges = {low[0] // 16, (low[0] + size[0] - 1) // 16}, {low[1] // 16}
        edges[1].add((low[1] + size[1] - 1) // 16)
        assert all(x in edges[0] or y in edges[1] for x, y in set(listed) - met)


def test_bricks_that_hold_marks(run):
    touched = np.random.default_rng(3).uniform(size=(3, 4, 2)) < 0.5
    keys, places = np.empty((24, 3), np.int32), np.empty(24, np.int64)
    count = run(update.list_touched)(touched, (-1, 5, 2), keys, places)
    wanted = np.argwhere(touched)
    np.testing.assert_array_equal(keys[:count], np.add(wanted, [-1, 5, 2]))
    x, y, word = wanted.T
    np.testing.assert_array_equal(places[:count], ((16 * x) * 64 + 16 * y) * 2 + word)
