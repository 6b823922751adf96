import numpy as np
import pytest

from wayproof.maps.kernels import lazy_distances as kernels


def both(kernel):
    return pytest.mark.parametrize("run", [kernel, kernel.py_func], ids=["compiled", "python"])


def near(marked, blocks_beside, planes_beside):
    """Whether any block around is marked, by a slice of the array for each."""
    found = np.zeros_like(marked)
    for b, x in np.ndindex(marked.shape):
        around = marked[max(0, b - blocks_beside) : b + blocks_beside + 1]
        found[b, x] = around[:, max(0, x - planes_beside) : x + planes_beside + 1].any()
    return found


@both(kernels.find_needed)
def test_sections_are_needed_within_reach_of_requested_blocks(run):
    rng = np.random.default_rng(1)
    for _ in range(20):
        requested, pending = rng.random((2, 5, 40)) < [[[0.05]], [[0.5]]]
        reach, needed = int(rng.integers(1, 12)), np.empty_like(requested)
        run(requested, pending, reach, needed)
        np.testing.assert_array_equal(needed, pending & near(requested, 0, reach - 1))


@both(kernels.dilate)
def test_blocks_and_planes_beside_are_marked_too(run):
    rng = np.random.default_rng(2)
    for _ in range(20):
        marked = rng.random((7, 30)) < 0.04
        beside = tuple(rng.integers(0, 5, 2).tolist())
        dilated = rng.random(marked.shape) < 0.5  # what was there before does not matter
        run(marked, *beside, dilated)
        np.testing.assert_array_equal(dilated, near(marked, *beside))


@both(kernels.write_optimistic)
def test_optimistic_distances_are_written_where_they_are_requested(run):
    rng, shape, rows = np.random.default_rng(3), (9, 13, 6), 4
    obstacles, not_free = rng.integers(0, 100, (2, *shape)).astype(np.uint16)
    requested = rng.random((4, 9)) < 0.5
    optimistic = np.full(shape, 12345, np.uint16)
    run(
        shape,
        rows,
        requested,
        obstacles.ravel(),
        not_free.ravel(),
        (36, 81),
        optimistic.reshape(-1),
    )
    expected = np.where(not_free < 36, np.minimum(obstacles, 36), np.minimum(obstacles, 81))
    written = requested.T[:, np.arange(13) // rows][:, :, None]
    np.testing.assert_array_equal(optimistic, np.where(written, expected, 12345))
