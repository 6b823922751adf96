"""The bricks of a map: found, evicted when memory is full, listed when their states change."""

import numpy as np

from tests.maps.sweeps import scattered
from wayproof.maps import FREE, UNKNOWN, MapConfig, VoxelMap
from wayproof.maps.kernels.bricks import column_states
from wayproof.maps.voxel.bricks import BYTES_IN_BRICK

FORWARD = np.array([[1.0, 0.0, 0.0]])


def make(memory_mib=4, **settings):
    return VoxelMap(MapConfig(memory_mib=memory_mib, **({"half_life": 0.0} | settings)))


def step_along(voxel_map, count, pitch=20.0, start=0):
    """One short beam every 20 m: two bricks each at most."""
    for k in range(start, start + count):
        origin = (pitch * k + 0.05, 0.05, 0.5)
        voxel_map.integrate(origin, FORWARD, np.array([500], np.uint16), 1.0, k)


def test_memory_stays_below_its_bound_and_the_oldest_bricks_go_first():
    voxel_map = make(memory_mib=1)
    capacity = 2**20 // BYTES_IN_BRICK
    step_along(voxel_map, 3 * capacity)
    at = np.array([[20.0 * k + 0.15, 0.05, 0.5] for k in range(3 * capacity)])
    known = np.flatnonzero(voxel_map.state_at(at) == FREE)
    assert len(known) >= capacity * 0.9
    assert known.tolist() == list(range(3 * capacity - len(known), 3 * capacity))
    bricks = voxel_map.memory_bytes() - voxel_map._rasterizer.nbytes
    assert bricks <= 1.01 * 2**20
    assert voxel_map.counts() == {"free": 5 * len(known), "occupied": len(known)}


def test_a_sweep_larger_than_the_memory_takes_what_fits():
    voxel_map = make(memory_mib=1)
    angles = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    directions = np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=1)
    ranges_mm = np.full(720, 20000, np.uint16)
    for time_ns in range(3):
        statistics = voxel_map.integrate((0.0, 0.0, 0.5), directions, ranges_mm, 30.0, time_ns)
        assert statistics.cells_updated == sum(voxel_map.counts().values()) > 0


def test_a_version_forgets_what_was_dropped():
    voxel_map, fresh = make(memory_mib=1), make(memory_mib=1)
    capacity = 2**20 // BYTES_IN_BRICK
    step_along(voxel_map, 10)
    before = voxel_map.version()
    step_along(voxel_map, capacity + 5, start=10)
    assert voxel_map.version() != before
    held = sum(voxel_map.counts().values()) // 6
    step_along(fresh, held, start=capacity + 15 - held)
    assert fresh.version() == voxel_map.version()


def inside(boxes, cell):
    return any(np.all(box[:3] <= cell) and np.all(cell < box[3:]) for box in boxes)


def test_the_change_set_holds_every_cell_whose_state_changed():
    voxel_map = make(half_life=2.0, memory_mib=1)
    rng = np.random.default_rng(0)
    low, shape = (-50, -50, -40), (100, 100, 2)
    before = voxel_map.columns(low, shape)
    followed = np.zeros_like(before)
    now, quiet = 0, 0
    for k in range(60):
        if k % 4 == 0:
            origin = rng.uniform(-2, 2, 3)
            directions, ranges_mm = scattered(rng, 10, 300, 2000)
            voxel_map.integrate(origin, directions, ranges_mm, 3.0, k * 500_000_000)
        else:
            voxel_map.advance(k * 500_000_000)
        after = voxel_map.columns(low, shape)
        differ = (before[0] ^ after[0]) | (before[1] ^ after[1])
        boxes, now = voxel_map.changed(now)
        voxel_map.rewrite_columns(low, boxes, *followed)
        np.testing.assert_array_equal(followed, after)
        for x, y, word in np.argwhere(differ)[::7]:
            bit = int(differ[x, y, word]) & -int(differ[x, y, word])
            cell = np.array([x, y, 64 * word + bit.bit_length() - 1]) + low
            assert inside(boxes, cell)
        quiet += len(boxes) == 0
        before = after
    assert 5 < quiet < 60
    assert len(voxel_map.changed(now)[0]) == 0


def test_a_cell_that_is_no_longer_free_is_a_change_though_it_is_not_occupied():
    voxel_map = make(log_odds_hit=0.4, log_odds_miss=0.4)
    for range_mm in (1000, 500):  # through the cell at 0.5 m, and up to it
        _, now = voxel_map.changed(0)
        voxel_map.integrate((0.05, 0.05, 0.5), FORWARD, np.array([range_mm], np.uint16), 2.0, 0)
    assert voxel_map.state_at([[0.55, 0.05, 0.5]]).tolist() == [UNKNOWN]
    assert len(voxel_map.changed(now)[0]) == 1


def test_cells_known_to_lie_at_the_lower_clamp_are_free():
    rng = np.random.default_rng(5)
    for _ in range(30):
        cells = rng.integers(-128, 128, 64).astype(np.int8)
        cells[rng.random(64) < 0.4] = 0
        cells[:16] = -60
        cells[16:40][rng.random(24) < 0.7] = -60
        known = rng.integers(0, 2**63, dtype=np.uint64) | np.uint64(0xFFFF)
        settled = np.packbits(cells == -60, bitorder="little").view(np.uint64)[0] & known
        for run in (column_states, column_states.py_func):
            with np.errstate(over="ignore"):
                occupied, free = run(cells.view(np.uint64), settled)
            assert [int(occupied) >> z & 1 for z in range(64)] == (cells > 0).tolist()
            assert [int(free) >> z & 1 for z in range(64)] == (cells < 0).tolist()
