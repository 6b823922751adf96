"""The beams of a sweep, cell by cell against a slow walk in exact fractions."""

from fractions import Fraction

import numpy as np
import pytest

from maps import MapConfig, VoxelMap
from maps import _voxel_kernels as kernels

SUBCELLS = 512
NO_FLOOR = 10**6


def naive_cells(start, end):
    """Cells along a beam between the middles of two sub-cells, in order."""
    cell = [q // SUBCELLS for q in start]
    faces = []
    for axis in range(3):
        extent = end[axis] - start[axis]
        first, last = cell[axis], end[axis] // SUBCELLS
        for face in range(first + 1, last + 1) if extent > 0 else range(first, last, -1):
            distance = face * SUBCELLS - start[axis] - Fraction(1, 2)
            faces.append((distance / extent, axis, 1 if extent > 0 else -1))
    cells = [tuple(cell)]
    for _, axis, step in sorted(faces):
        cell[axis] += step
        cells.append(tuple(cell))
    return cells


def naive_crossed(shape, start, end, returned, floor_layer):
    """The cells that one beam takes evidence from."""
    cells = naive_cells(start, end)
    onto_floor = returned and cells[-1][2] == floor_layer and cells[0][2] > floor_layer
    return {
        cell
        for cell in (cells[:-1] if returned else cells)
        if all(0 <= index < size for index, size in zip(cell, shape, strict=True))
        and not (onto_floor and cell[2] == floor_layer)
    }


def random_beams(shape, count, seed):
    """Ends within and around the map; every third beam is along axes or diagonals, to meet ties."""
    rng = np.random.default_rng(seed)
    size = np.array(shape) * SUBCELLS
    start = rng.integers(-size, 2 * size, (count, 3))
    start[::2] = rng.integers(0, size, (len(start[::2]), 3))
    end = rng.integers(-size, 2 * size, (count, 3))
    length = rng.integers(1, 6 * SUBCELLS, (len(end[::3]), 1))
    end[::3] = start[::3] + rng.integers(-1, 2, (len(end[::3]), 3)) * length
    return start, end


@pytest.mark.parametrize("cross", [kernels.cross_cells, kernels.cross_cells.py_func])
@pytest.mark.parametrize("shape", [(9, 7, 5), (1, 12, 3), (2, 1, 1)])
def test_each_beam_crosses_the_cells_of_the_exact_walk(cross, shape):
    starts, ends = random_beams(shape, 400, seed=3)
    crossed_any = 0
    for i, (start, end) in enumerate(zip(starts, ends, strict=True)):
        returned, floor_layer = bool(i % 2), (1 if i % 5 else NO_FLOOR)
        marks = np.zeros(shape, np.uint8)
        cross(marks, start, end, returned, floor_layer)
        expected = naive_crossed(shape, start.tolist(), end.tolist(), returned, floor_layer)
        assert {tuple(cell) for cell in np.argwhere(marks).tolist()} == expected
        crossed_any += bool(expected)
    assert crossed_any > 100


def test_the_longest_beam_does_not_overflow():
    reach = kernels.MAX_BEAM_CELLS * SUBCELLS
    marks = np.zeros((2048, 1, 1), np.uint8)
    for end in ([reach, 0, 0], [reach, reach, reach], [reach, 5, 5]):
        marks[:] = 0
        kernels.cross_cells(marks, np.zeros(3, np.int64), np.array(end), False, NO_FLOOR)
        assert marks.sum() == (2048 if end[1] < SUBCELLS else 2)  # through edges x goes first


def naive_integrate(log_odds, grid, config, origin, directions, ranges_mm, limit_mm):
    """One sweep, straight from the definition."""
    resolution, corner = grid.resolution, grid.origin
    start = [int(np.floor(q)) for q in (origin - corner) * (SUBCELLS / resolution)]
    hits, crossed = set(), set()
    for direction, millimetres in zip(directions, ranges_mm.tolist(), strict=True):
        if millimetres == 0 or millimetres < 1000 * config.minimum_range:
            continue
        returned = millimetres <= limit_mm
        length = min(millimetres, limit_mm) / 1000.0
        end = (origin - corner + direction * length) * (SUBCELLS / resolution)
        end = [int(np.floor(q)) for q in end]
        crossed |= naive_crossed(log_odds.shape, start, end, returned, grid.floor_layer)
        cell = tuple(q // SUBCELLS for q in end)
        if returned and all(0 <= c < n for c, n in zip(cell, log_odds.shape, strict=True)):
            hits.add(cell)
    for cell in hits:
        log_odds[cell] = min(log_odds[cell] + 900, 3476)
    for cell in crossed - hits:
        log_odds[cell] = max(log_odds[cell] - 400, -1992)
    return len(hits | crossed)


def random_sweep(rng, count):
    directions = rng.normal(size=(count, 3))
    directions[::7] = np.eye(3)[rng.integers(0, 3, len(directions[::7]))]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ranges_mm = rng.integers(1, 4000, count).astype(np.uint16)
    ranges_mm[::5] = 65535
    ranges_mm[::11] = 0
    return directions, ranges_mm


def test_sweeps_equal_the_definition_cell_by_cell():
    rng = np.random.default_rng(5)
    config = MapConfig(half_life=0.0)
    voxel_map = VoxelMap(config, (0.0, 0.0, -0.3), (2.3, 1.7, 1.2))
    log_odds = np.zeros(voxel_map.shape, np.int64)
    for k in range(8):
        origin = rng.uniform((-0.5, -0.5, -0.5), (2.8, 2.2, 1.6))
        directions, ranges_mm = random_sweep(rng, 150)
        statistics = voxel_map.integrate(origin, directions, ranges_mm, 3.0, k)
        updated = naive_integrate(
            log_odds, voxel_map.grid, config, origin, directions, ranges_mm, 3000
        )
        assert statistics.cells_updated == updated
        np.testing.assert_array_equal(voxel_map.log_odds, log_odds)
    assert {*np.unique(voxel_map.states())} == {0, 1, 2}
