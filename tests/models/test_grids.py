"""Distances and ways in grids, compiled and as Python, against scipy's."""

import itertools

import numpy as np
import pytest
from scipy import ndimage, sparse
from scipy.sparse import csgraph

from tests.models.interpreting import interpret_kernels
from wayproof.models.grids import distances, ways

SHAPES = [(30, 20), (1, 9), (9, 1), (7, 6, 5), (12, 9, 1)]


@pytest.fixture(params=["compiled", "interpreted"])
def _either(request, monkeypatch):
    if request.param == "interpreted":
        interpret_kernels(monkeypatch)


def drawn(shape, share):
    """Cells with a share of them set, the first among these."""
    cells = np.random.default_rng(3).random(shape) < share
    cells.flat[0] = True
    return cells


def graph(free, corners, rounds):
    """Edges between neighbouring free cells (n, n), by the axes along which they differ."""
    edges = {}
    for cell in np.argwhere(free):
        for step in itertools.product((-1, 0, 1), repeat=free.ndim):
            other, axes = cell + step, np.abs(step).sum()
            if rounds:
                other[0] %= free.shape[0]
            inside = (other >= 0).all() and (other < free.shape).all()
            if axes and inside and free[tuple(other)] and (corners or axes == 1):
                pair = tuple(np.ravel_multi_index(at, free.shape) for at in (cell, other))
                edges[pair] = min(edges.get(pair, 2.0), np.sqrt(axes))
    ends = tuple(zip(*edges, strict=True))
    return sparse.csr_matrix((list(edges.values()), ends), (free.size,) * 2)


@pytest.mark.usefixtures("_either")
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("share", [0.01, 0.3, 1.0])
def test_distances_are_those_to_the_nearest_marked_cell(shape, share):
    marked = drawn(shape, share)
    np.testing.assert_array_equal(distances(marked), ndimage.distance_transform_edt(~marked))


@pytest.mark.usefixtures("_either")
def test_without_a_marked_cell_all_distances_are_beyond_any_grid():
    assert (distances(np.zeros((4, 3, 2), np.bool_)) > 1e6).all()


@pytest.mark.usefixtures("_either")
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("corners", [True, False])
@pytest.mark.parametrize("rounds", [True, False])
def test_ways_are_the_shortest_and_lead_from_cell_to_cell(shape, corners, rounds):
    free, size = drawn(shape, 0.7), 0.05
    ends = np.flatnonzero(free)[[0, -1]]
    lengths, after = ways(free, ends, size, corners=corners, rounds=rounds)
    edges = graph(free, corners, rounds) * size
    expected = csgraph.dijkstra(edges, indices=ends, min_only=True)
    np.testing.assert_array_equal(lengths.ravel(), expected)
    for cell in np.flatnonzero(np.isfinite(expected)):
        if cell in ends:
            assert after[cell] == -1
        else:
            assert lengths.flat[cell] == lengths.flat[after[cell]] + edges[cell, after[cell]]


def test_a_way_to_one_cell_is_looked_for_no_farther():
    free = np.ones((9, 9), np.bool_)
    whole, near = (ways(free, [0], 1.0, until=until)[0] for until in (-1, 10))
    assert near[1, 1] == whole[1, 1]
    assert np.isinf(near[8, 8])
