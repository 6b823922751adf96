import numpy as np
import pytest

from wayproof.maps.kernels import lazy_distances as kernels


def ways(kernel):
    return pytest.mark.parametrize("way", [kernel, kernel.py_func], ids=["compiled", "python"])


def near(marked, blocks_beside, planes_beside):
    """Whether any is marked so near, each block asked for itself."""
    told = np.zeros_like(marked)
    for b, x in np.ndindex(marked.shape):
        around = marked[max(0, b - blocks_beside) : b + blocks_beside + 1]
        told[b, x] = around[:, max(0, x - planes_beside) : x + planes_beside + 1].any()
    return told


@ways(kernels.find_needed)
def test_sections_are_needed_within_reach_of_what_is_wanted(way):
    rng = np.random.default_rng(1)
    for _ in range(20):
        wanted, pending = rng.random((2, 5, 40)) < [[[0.05]], [[0.5]]]
        reach, needed = int(rng.integers(1, 12)), np.empty_like(wanted)
        way(wanted, pending, reach, needed)
        np.testing.assert_array_equal(needed, pending & near(wanted, 0, reach - 1))


@ways(kernels.widen)
def test_blocks_and_planes_beside_are_marked_too(way):
    rng = np.random.default_rng(2)
    for _ in range(20):
        marked = rng.random((7, 30)) < 0.04
        beside = tuple(rng.integers(0, 5, 2).tolist())
        wide = rng.random(marked.shape) < 0.5  # what was there before does not matter
        way(marked, *beside, wide)
        np.testing.assert_array_equal(wide, near(marked, *beside))


@ways(kernels.presume)
def test_distances_are_presumed_where_they_are_wanted(way):
    rng, shape, rows = np.random.default_rng(3), (9, 13, 6), 4
    obstacles, not_free = rng.integers(0, 100, (2, *shape)).astype(np.uint16)
    wanted = rng.random((4, 9)) < 0.5
    presumed = np.full(shape, 12345, np.uint16)
    for part in ((0, 1), (1, 4)):
        way(
            part,
            shape,
            rows,
            wanted,
            obstacles.ravel(),
            not_free.ravel(),
            36,
            81,
            presumed.reshape(-1),
        )
    expected = np.where(not_free < 36, np.minimum(obstacles, 36), np.minimum(obstacles, 81))
    there = wanted.T[:, np.arange(13) // rows][:, :, None]
    np.testing.assert_array_equal(presumed, np.where(there, expected, 12345))
