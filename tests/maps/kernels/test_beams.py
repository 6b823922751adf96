import numpy as np
import pytest

from tests.maps.sweeps import random_sweep
from wayproof.maps.kernels import beams as kernels


def unpacked(end, origin_cells):
    """Cell, fate and origin of a packed end."""
    cell = [end >> shift & 8191 for shift in (26, 13, 0)]
    origin = origin_cells[end >> 40]
    cell = [a + int(b) - kernels.HALF_SPAN for a, b in zip(cell, origin, strict=True)]
    return [*cell, end >> 39 & 1, end >> 40]


def scratch():
    return np.empty((4, kernels.CHUNK), np.int64), np.empty(kernels.CHUNK, np.int64)


@pytest.mark.parametrize("run", [kernels.place_ends, kernels.place_ends.py_func])
def test_ends_of_single_beams(run):
    directions = np.repeat([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]], 3, axis=0)
    ranges_mm = np.array([0, 100, 1000, 65535, 2001, 2000], np.uint16)
    ends, counts = np.zeros(6, np.int64), np.zeros(4, np.int64)
    box = np.array([[0, 1, 3], [0, 1, 3]])
    origin, groups = np.array([[0.05, 0.15, 0.25]]), np.array([0, 6])
    sensor, own = np.array([[256, 768, 1664]]), [[0, 1, 3]]
    beams = kernels.SweepBeams(
        origin, sensor, groups, directions.reshape(-1), ranges_mm, (300, 2000), 0.1
    )
    lists = kernels.EndLists(ends, box, counts)
    # -1.75 m is 16.75 cells below the floor's layer; two beams that only clear end there.
    expected = [[10, 1, 3, 0, 0], [0, 1, -17, 1, 0], [0, 1, -17, 0, 0]]
    assert run(beams, lists, *scratch()) == 3
    assert [unpacked(end, own) for end in ends[:3].tolist()] == expected
    assert counts.tolist() == [2, 2, 1, 1]
    assert box.tolist() == [[0, 1, -17], [10, 1, 3]]
    directions[4, 1] = 1e-2
    assert run(beams, lists, *scratch()) == -1


@pytest.mark.parametrize("run", [kernels.place_ends, kernels.place_ends.py_func])
def test_ends_of_beams_from_many_origins(run):
    rng = np.random.default_rng(4)
    directions, ranges_mm = random_sweep(rng, 700, 5000)
    origins, groups = rng.uniform(-1, 1, (4, 3)), np.array([0, 10, 10, 600, 700])
    moments = np.repeat(np.arange(4), np.diff(groups))
    lengths = np.minimum(ranges_mm, 3000) / 1000.0
    scaled = np.floor((origins[moments] + directions * lengths[:, None]) * (512 / 0.1))
    cells = (scaled.astype(int) + np.array([0, 0, 384])) // 512
    fates = np.where(ranges_mm > 3000, 1, 0)
    rows = np.column_stack([cells, fates, moments])[ranges_mm >= 300]
    sensors = np.floor(origins * (512 / 0.1)).astype(int) + np.array([0, 0, 384])
    counts = np.zeros(4, np.int64)
    flat = directions.reshape(-1)
    beams = kernels.SweepBeams(origins, sensors, groups, flat, ranges_mm, (300, 3000), 0.1)
    ends, box = np.zeros(700, np.int64), np.zeros((2, 3), np.int64)
    listed = run(beams, kernels.EndLists(ends, box, counts), *scratch())
    found = [unpacked(end, sensors // 512) for end in ends[:listed].tolist()]
    assert [row[4] for row in found] == sorted(row[4] for row in found)
    assert all(np.all((box[0] <= r[:3]) & (r[:3] <= box[1])) for r in found)
    other = np.any(np.diff(rows, axis=0) != 0, axis=1)
    assert {tuple(row) for row in found} == {tuple(row) for row in rows.tolist()}
    assert len(found) >= 1 + np.count_nonzero(other)
    fated = np.count_nonzero(fates[ranges_mm >= 300] == 0), np.count_nonzero(fates)
    dropped = np.count_nonzero(ranges_mm == 0)
    assert counts.tolist() == [*fated, dropped, 700 - sum(fated) - dropped]


@pytest.mark.parametrize("strange", [np.nan, np.inf, -np.inf, 1e6 + 1.0, -1e7])
@pytest.mark.parametrize("run", [kernels.locate_sensors, kernels.locate_sensors.py_func])
def test_sub_cells_of_sensors(run, strange):
    origins = np.random.default_rng(4).uniform(-50.0, 50.0, (20, 3))
    origins[3] = 1e6, -1e6, 0.0
    sensors = np.empty((20, 3), np.int64)
    assert run(origins, 1e6, 5120.0, sensors) == -1
    np.testing.assert_array_equal(sensors, np.floor(origins * 5120.0 + [0.0, 0.0, 384.0]))
    for axis in range(3):
        bad = origins.copy()
        bad[7, axis] = strange
        assert run(bad, 1e6, 5120.0, sensors) == 7
