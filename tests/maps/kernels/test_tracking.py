import numpy as np
import pytest

from wayproof.maps.kernels import tracking as kernels
from wayproof.maps.others.tracking import clusters_of


def random_set(rng, count, size):
    return np.unique(rng.integers(-size, size, (count, 3)), axis=0)


@pytest.mark.parametrize("run", [kernels.label_components, kernels.label_components.py_func])
def test_components_equal_a_slow_flood(run):
    for seed in range(6):
        cells = random_set(np.random.default_rng(seed), 60, 9)
        labels = np.empty(len(cells), np.int64)
        components = run(cells, labels)
        flood, number = np.full(len(cells), -1), 0
        for start in range(len(cells)):
            if flood[start] >= 0:
                continue
            reached = np.arange(len(cells)) == start
            for _ in range(len(cells)):
                gaps = np.abs(cells[:, None] - cells[reached]).max(axis=2)
                reached = (gaps <= 2).any(axis=1)
            flood[reached] = number
            number += 1
        assert components == number > 1
        np.testing.assert_array_equal(labels, flood)
        assert sum(map(len, clusters_of(cells))) == len(cells)


@pytest.mark.parametrize("run", [kernels.find_indices, kernels.find_indices.py_func])
def test_indices_of_cells_in_a_set(run):
    rng = np.random.default_rng(1)
    cells, queries = random_set(rng, 100, 4), rng.integers(-5, 5, (300, 3))
    indices = np.empty(300, np.int64)
    run(cells, queries, indices)
    index = {tuple(cell): i for i, cell in enumerate(cells.tolist())}
    assert indices.tolist() == [index.get(tuple(cell), -1) for cell in queries.tolist()]


@pytest.mark.parametrize("run", [kernels.erode, kernels.erode.py_func])
def test_erosion_equals_a_slow_minimum_over_neighbours(run):
    rng = np.random.default_rng(2)
    dense = rng.random((48, 48, 192)) < 0.97
    dense[:, 20:, 70:] = True
    words = np.packbits(dense, axis=2, bitorder="little").view(np.uint64)  # (48, 48, 3)
    columns = np.stack(
        [
            words[16 * x : 16 * x + 16, 16 * y : 16 * y + 16, z].reshape(256)
            for x, y, z in np.ndindex(3, 3, 3)
        ]
    )
    eroded = np.empty((2, 256), np.uint64)
    around = np.stack([np.arange(27).reshape(3, 3, 3), np.full((3, 3, 3), -1)])
    around[1, 1, 1, 1] = 26
    run(columns, around, eroded)
    slow = np.ones((16, 16, 64), np.bool_)
    for x, y, z in np.ndindex(3, 3, 3):
        slow &= dense[15 + x : 31 + x, 15 + y : 31 + y, 63 + z : 127 + z]
    bits = np.unpackbits(eroded[0].reshape(16, 16, 1).view(np.uint8), axis=2, bitorder="little")
    np.testing.assert_array_equal(bits.astype(np.bool_), slow)
    assert 0 < slow.sum() < slow.size
    # Without neighbours nothing at the edge is left.
    edge = eroded[1].reshape(16, 16)
    assert not edge[[0, -1]].any()
    assert not edge[:, [0, -1]].any()
    assert not (edge & np.uint64(1 | 1 << 63)).any()
    assert edge.any()


@pytest.mark.parametrize("run", [kernels.move_bits, kernels.move_bits.py_func])
def test_bits_of_cells_move_from_mask_to_mask(run):
    source, target = np.full((2, 2, 2), 0b1011, np.uint64), np.zeros((2, 2, 2), np.uint64)
    cells = np.array([[5, 6, -3], [5, 6, -1], [6, 7, 61], [7, 7, 0], [5, 6, 125], [5, 6, -4]])
    run((5, 6, -3), cells, True, source, target)
    assert source[0, 0].tolist() == [0b1010, 0b1011]
    assert target[0, 0].tolist() == [1, 0]  # cell 2 was not set, and 128 is outside
    assert (source[1, 1].tolist(), target[1, 1].tolist()) == ([0b1011, 0b1010], [0, 1])
    run((5, 6, -3), cells[1:2], False, source, target)
    assert target[0, 0].tolist() == [0b101, 0]
