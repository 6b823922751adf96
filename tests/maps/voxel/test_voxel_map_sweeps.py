"""The sweeps of a voxel map, cell by cell against slow walks straight from the definition."""

import numpy as np

from tests.maps.naive_beams import naive_cells
from tests.maps.sweeps import random_sweep
from wayproof.maps import MapConfig, VoxelMap
from wayproof.maps.kernels import beams as kernels


def naive_integrate(log_odds, voxel_map, limit_mm, spared, origins, moments, beams):
    """One sweep, straight from the definition; `log_odds` is a dictionary by cell."""
    config, evidence = voxel_map.config, voxel_map.evidence
    scale = 512 / config.resolution
    shift = np.array([0.0, 0.0, 384.0])
    hits, crossed = set(), set()
    for i, (direction, millimetres) in enumerate(zip(*beams, strict=True)):
        origin = origins[moments[i]]
        if millimetres == 0 or millimetres < 1000 * config.minimum_range:
            continue
        returned = millimetres <= limit_mm
        length = min(int(millimetres), limit_mm) / 1000.0
        sensor = [2 * int(q) + 1 for q in np.floor(origin * scale + shift)]
        at = np.floor((origin + direction * length) * scale).astype(int) + shift.astype(int)
        end = tuple(int(q) for q in at // 512)
        guard = {"own": "own", "floor": True, "none": False}[spared]
        crossed |= naive_cells(sensor, end, returned, guard)
        if returned:
            hits.add(end)
    for cell in hits:
        log_odds[cell] = min(log_odds.get(cell, 0) + evidence.hit, evidence.high)
    for cell in crossed - hits:
        log_odds[cell] = max(log_odds.get(cell, 0) - evidence.miss, evidence.low)
    return len(hits | crossed)


def units_of(voxel_map, cells):
    """Log-odds of cells in units, by way of the probabilities."""
    middles = (np.array(cells) + np.array([0.5, 0.5, -0.25])) * voxel_map.resolution
    odds = voxel_map.probability_at(middles)
    return np.rint(np.log(odds / (1.0 - odds)) * voxel_map.evidence.units).astype(int)


def test_sweeps_equal_the_definition_cell_by_cell():
    for seed in range(30):
        rng = np.random.default_rng(seed)
        resolution = float(rng.choice([0.05, 0.1, 0.2]))
        config = MapConfig(
            resolution=resolution,
            half_life=0.0,
            memory_mib=16,
        )
        voxel_map, log_odds = VoxelMap(config), {}
        spared = ("none", "floor", "own")[seed % 3]
        place = rng.choice([0.0, -50.0, 9e5], 3) * [1.0, 1.0, seed % 5 == 0]
        for k in range(8):
            count = int(rng.integers(1, 4)) if k % 2 else 1
            origins = place + rng.uniform(-0.4, 0.9, (count, 3))
            beams = random_sweep(rng, 24, round(resolution * 20e3))
            moments = rng.integers(0, count, 24).astype(np.int32)
            limit = 16 * resolution
            taken = (origins, moments) if k % 2 else (origins[0], None)
            statistics = voxel_map.integrate(taken[0], *beams, limit, k, taken[1], spared)
            updated = naive_integrate(
                log_odds, voxel_map, round(limit * 1000), spared, origins, moments, beams
            )
            assert statistics.cells_updated == updated
        cells = sorted(log_odds)
        values = np.array([log_odds[cell] for cell in cells])
        np.testing.assert_array_equal(units_of(voxel_map, cells), values)
        expected = {"free": np.count_nonzero(values < 0), "occupied": np.count_nonzero(values > 0)}
        assert voxel_map.counts() == expected


def test_the_longest_beam_does_not_overflow():
    reach = kernels.MAX_BEAM_CELLS
    config = MapConfig(half_life=0.0, memory_mib=64)
    for direction in ([1.0, 0.0, 0.0], [0.6, 0.8, 0.0], [0.36, 0.48, 0.8]):
        voxel_map = VoxelMap(config)
        beam, clear = np.array([direction]), np.array([65535], np.uint16)
        voxel_map.integrate((0.05, 0.05, 0.0), beam, clear, reach * config.resolution, 0)
        middles = np.outer(np.arange(0.0, 204.0, 5.0), direction) + np.array([0.05, 0.05, 0.0])
        near = np.array([[x, y, z] for x in (-0.1, 0, 0.1) for y in (-0.1, 0, 0.1) for z in (0.0,)])
        states = [voxel_map.state_at(middle + near) for middle in middles]
        assert np.any(np.array(states) == 1, axis=1).all()
