import numpy as np
import pytest

from wayproof.maps.kernels import bricks as kernels


def both(kernel):
    return pytest.mark.parametrize("run", [kernel, kernel.py_func], ids=["compiled", "python"])


def draw_boxes(rng, count):
    low = rng.integers(-40, 60, (count, 3))
    return np.hstack([low, low + rng.integers(0, 40, (count, 3))])


@both(kernels.list_blocks)
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
        count = run(boxes, *window, touched, blocks)
        listed = [tuple(block) for block in blocks[:count].tolist()]
        assert listed == sorted(set(listed))
        assert met <= set(listed)
        # What is written besides is written as it is: only at the window's edge, beside a box.
        edges = {low[0] // 16, (low[0] + size[0] - 1) // 16}, {low[1] // 16}
        edges[1].add((low[1] + size[1] - 1) // 16)
        assert all(x in edges[0] or y in edges[1] for x, y in set(listed) - met)


@both(kernels.column_states)
def test_states_of_a_column(run):
    rng = np.random.default_rng(5)
    for _ in range(30):
        cells = rng.integers(-128, 128, 64).astype(np.int8)
        cells[rng.random(64) < 0.4] = 0
        cells[:16] = -60
        cells[16:40][rng.random(24) < 0.7] = -60
        known = rng.integers(0, 2**63, dtype=np.uint64) | np.uint64(0xFFFF)
        settled = np.packbits(cells == -60, bitorder="little").view(np.uint64)[0] & known
        with np.errstate(over="ignore"):
            occupied, free = run(cells.view(np.uint64), settled)
        assert [int(occupied) >> z & 1 for z in range(64)] == (cells > 0).tolist()
        assert [int(free) >> z & 1 for z in range(64)] == (cells < 0).tolist()
