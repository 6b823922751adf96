"""The beams of a sweep, cell by cell against slow walks straight from the definition."""

from fractions import Fraction

import numpy as np
import pytest

from wayproof.maps import MapConfig, VoxelMap
from wayproof.maps.kernels import beams as kernels
from wayproof.maps.kernels import carve as carving
from wayproof.maps.kernels.work_queue import new_queue
from wayproof.maps.voxel.update_mask import SPREAD

HALVES = 1024
KERNELS = {**vars(kernels), "carve": carving.carve}
WAYS = 2**40


def from_middle(sensor, end):
    """The way from the middle of the end cell to the sensor, in 1/1024 of a cell."""
    return [q - (HALVES * c + HALVES // 2) for q, c in zip(sensor, end, strict=True)]


def naive_cells(sensor, end, returned, guard):
    """The cells that a beam crosses, from its end cell to the sensor (in 1/1024 of a cell)."""
    cell = [q // HALVES for q in sensor]
    way = from_middle(sensor, end)
    faces = []
    for axis in range(2):
        half = 2**49 // abs(way[axis])
        for k in range(abs(cell[axis] - end[axis])):
            faces.append(((2 * k + 1) * half, axis))
    x, y, z = end
    crossed = set()
    for fraction, axis in [*sorted(faces), (None, None)]:
        leave = cell[2]
        if fraction is not None:
            middle = HALVES * end[2] + HALVES // 2
            leave = int((middle + Fraction(fraction, WAYS) * way[2]) // HALVES)
        crossed |= {(x, y, height) for height in range(min(z, leave), max(z, leave) + 1)}
        z = leave
        x += (axis == 0) * (1 if way[0] > 0 else -1)
        y += (axis == 1) * (1 if way[1] > 0 else -1)
    if guard and returned and end[2] == 0 and cell[2] > 0:
        crossed = {c for c in crossed if c[2] != 0}
    return crossed


def exact_columns(sensor, end):
    """The columns on the straight line, by fractions, where it meets no edge."""
    way = from_middle(sensor, end)
    columns, x, y = {(end[0], end[1])}, end[0], end[1]
    faces = []
    for axis in range(2):
        for k in range(abs(sensor[axis] // HALVES - end[axis])):
            faces.append((Fraction((2 * k + 1) * HALVES, 2 * abs(way[axis])), axis))
    for _, axis in sorted(faces):
        x += (axis == 0) * (1 if way[0] > 0 else -1)
        y += (axis == 1) * (1 if way[1] > 0 else -1)
        columns.add((x, y))
    return columns


def naive_integrate(log_odds, evidence, config, origins, moments, beams, limit_mm):
    """One sweep, straight from the definition; `log_odds` is a dictionary by cell."""
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
        crossed |= naive_cells(sensor, end, returned, config.floor_grazing_filter)
        if returned:
            hits.add(end)
    for cell in hits:
        log_odds[cell] = min(log_odds.get(cell, 0) + evidence.hit, evidence.high)
    for cell in crossed - hits:
        log_odds[cell] = max(log_odds.get(cell, 0) - evidence.miss, evidence.low)
    return len(hits | crossed)


def random_sweep(rng, count, reach_mm):
    directions = rng.normal(size=(count, 3))
    directions[::7] = np.eye(3)[rng.integers(0, 3, len(directions[::7]))]
    directions[3::7] = rng.choice([-1.0, 1.0], (len(directions[3::7]), 3)) * [1.0, 1.0, 0.0]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ranges_mm = rng.integers(1, reach_mm, count).astype(np.uint16)
    ranges_mm[::5] = 65535
    ranges_mm[::11] = 0
    return directions, ranges_mm


def units_of(voxel_map, cells):
    """Log-odds of cells in units, by way of the probabilities."""
    middles = (np.array(cells) + np.array([0.5, 0.5, -0.25])) * voxel_map.resolution
    odds = voxel_map.probability_at(middles)
    return np.rint(np.log(odds / (1.0 - odds)) * voxel_map.evidence.units).astype(int)


@pytest.mark.parametrize("threads", [1, 3])
def test_a_thousand_sweeps_equal_the_definition_cell_by_cell(threads):
    sweeps = 0
    for seed in range(125 if threads == 1 else 15):
        rng = np.random.default_rng(seed)
        resolution = float(rng.choice([0.05, 0.1, 0.2]))
        guard = "floor" if seed % 2 else "none"
        config = MapConfig(
            resolution=resolution, half_life=0.0, floor_grazing_filter=guard, memory_mib=16
        )
        voxel_map, log_odds = VoxelMap(config, threads), {}
        place = rng.choice([0.0, -50.0, 9e5], 3) * [1.0, 1.0, seed % 3 == 0]
        for k in range(8):
            count = int(rng.integers(1, 4)) if k % 2 else 1
            origins = place + rng.uniform(-0.4, 0.9, (count, 3))
            beams = random_sweep(rng, 24, round(resolution * 20e3))
            moments = rng.integers(0, count, 24).astype(np.int32)
            limit = 16 * resolution
            statistics = voxel_map.integrate(
                origins if k % 2 else origins[0], *beams, limit, k, moments if k % 2 else None
            )
            updated = naive_integrate(
                log_odds, voxel_map.evidence, config, origins, moments, beams, round(limit * 1000)
            )
            assert statistics.cells_updated == updated
            sweeps += 1
        cells = sorted(log_odds)
        values = np.array([log_odds[cell] for cell in cells])
        np.testing.assert_array_equal(units_of(voxel_map, cells), values)
        expected = {"free": np.count_nonzero(values < 0), "occupied": np.count_nonzero(values > 0)}
        assert voxel_map.counts() == expected
    assert sweeps >= (1000 if threads == 1 else 100)


def packed(cell, own, fate, origin):
    """An end as the kernels write it."""
    x, y, z = (int(a) - int(b) + kernels.HALF_SPAN for a, b in zip(cell, own, strict=True))
    return x << 26 | y << 13 | z | fate << 39 | origin << 40


def unpacked(end, own):
    """Cell, fate and origin of one."""
    cell = [end >> shift & 8191 for shift in (26, 13, 0)]
    cell = [a + int(b) - kernels.HALF_SPAN for a, b in zip(cell, own[end >> 40], strict=True)]
    return [*cell, end >> 39 & 1, end >> 40]


def carve(run, sensor, ends, shape, guarded=-1, hit=True, box=None):
    """Cells of the free marks for beams to the given ends, and those of the hits."""
    own, kernel = [h // HALVES for h in sensor], lambda name: KERNELS[name]
    if run == "python":
        kernel = lambda name: KERNELS[name].py_func  # noqa: E731
    nx, ny, words = shape
    box = box or (0, 0, 0, nx - 1, ny - 1, 64 * words - 1)
    hits, free, aims = (np.zeros(nx * ny * words, np.uint64) for _ in range(3))
    flags, (columns, ranks, order) = np.zeros(nx * ny, np.uint8), np.empty((3, len(ends)), np.int32)
    targets, bits = np.empty((len(ends), 5), np.int32), np.empty(len(ends), np.uint64)
    wedges, sensors = np.empty((len(ends), 3), np.int64), np.array([sensor])
    starts, fate = np.empty(kernels.SECTORS + 1, np.int64), 0 if hit else 1
    stripes = [[], []]
    for end in ends:
        stripes[end[0] >> kernels.STRIPE_BITS & 1].append(packed(end, own, fate, 0))
    firsts, groups = np.array([0, len(stripes[0])]), np.empty((2, 2), np.int64)
    with np.errstate(over="ignore"):
        for first, listed, group in zip(firsts, stripes, groups, strict=True):
            half, some = len(listed) // 2, slice(first, first + len(listed))
            parts = np.array([[0, half], [half, half], [half, len(listed)]])
            kernel("list_targets")(
                *(np.array(listed, np.int64), parts, sensors, box, guarded, shape, SPREAD),
                *(hits, aims, flags, columns[some], targets[some], bits[some], ranks[some], group),
            )
        count = int(groups[:, 1].sum())
        some = kernel("order_targets")(ranks, firsts, groups, starts, order, wedges)
        held = [f + i for f, group in zip(firsts, groups, strict=True) for i in range(group[1])]
        assert sorted(order[:count]) == held
        assert wedges[:some, 0].tolist() == [0, *wedges[: some - 1, 1]]
        queue = new_queue()
        of_beams = (targets, bits, order, wedges[:some], queue, sensors, box, guarded)
        scratch = tuple(np.empty(carving.MAX_STEPS + 1, np.int64) for _ in range(5))
        rows = np.empty((carving.MAX_RUNS * words, 3), np.int64)
        masks = np.empty(carving.MAX_STEPS + 1, np.uint64)
        kernel("carve")(*of_beams, shape, scratch, masks, rows, free)
        assert queue[0] == some + 1  # one more than there are was asked for
    assert not aims.any()
    assert not flags.any()

    def cells(words_):
        bits = np.unpackbits(words_.view(np.uint8).reshape(nx, ny, -1), axis=2, bitorder="little")
        return {tuple(cell) for cell in np.argwhere(bits).tolist()}

    return cells(free), cells(hits)


@pytest.mark.parametrize("run", ["compiled", "python"])
@pytest.mark.parametrize("shape", [(16, 16, 1), (16, 32, 3)])
def test_runs_of_ends_cross_what_each_of_their_beams_crosses(run, shape):
    rng = np.random.default_rng(3)
    size = np.array([shape[0], shape[1], 64 * shape[2]])
    for k in range(40 if run == "compiled" else 4):
        sensor = (2 * rng.integers(0, size * 512) + 1).tolist()
        ends = rng.integers(0, size, (6, 3))
        run_of_ends = np.repeat(ends[:1], 9, axis=0)
        run_of_ends[:, 2] = np.arange(9) + rng.integers(0, size[2] - 9)
        ends = np.vstack([ends, run_of_ends]).tolist()
        hit = bool(k % 2)
        guarded = int(run_of_ends[4, 2]) if k % 3 else -1
        free, hits = carve(run, sensor, ends, shape, guarded, hit)
        assert free == expected_cells(sensor, ends, guarded, hit)
        assert hits == ({tuple(end) for end in ends} if hit else set())


def expected_cells(sensor, ends, guarded, hit):
    """Cells that beams cross, with the layer that they spare."""
    expected = set()
    for end in ends:
        shifted = [*sensor[:2], sensor[2] - HALVES * guarded]  # the floor's layer is layer 0
        crossed = naive_cells(shifted, (*end[:2], end[2] - guarded), hit, guarded >= 0)
        expected |= {(x, y, z + guarded) for x, y, z in crossed}
    return expected


@pytest.mark.parametrize("run", ["compiled", "python"])
def test_of_beams_from_and_to_anywhere_the_cells_in_a_box_are_marked(run):
    rng = np.random.default_rng(5)
    shape, size = (16, 32, 2), np.array([16, 32, 128])
    met = 0
    for k in range(400 if run == "compiled" else 10):
        box = np.sort(rng.integers(0, size, (2, 3)), axis=0)
        wide = size + 40
        sensor = (2 * rng.integers(-40 * 512, wide * 512) + 1).tolist()
        ends = rng.integers(-40, wide, (12, 3))
        ends[:4] = rng.integers(box[0], box[1] + 1, (4, 3))
        ends[4:8, :2] = ends[:4, :2]  # above and below those in the box
        if k % 5 == 0:
            ends[:, :2] = ends[:1, :2] + np.arange(12)[:, None]  # diagonals meet edges
            sensor[1] = sensor[0] + HALVES * int(ends[0, 1] - ends[0, 0])
        hit, guarded = bool(k % 2), int(ends[k % 12, 2]) if k % 3 else -1
        guarded = guarded if 0 <= guarded < 128 else -1
        limits = (*box[0].tolist(), *box[1].tolist())
        free, hits = carve(run, sensor, ends.tolist(), shape, guarded, hit, limits)

        def inside(cells, box=box):
            return {c for c in cells if np.all(box[0] <= c) and np.all(np.array(c) <= box[1])}

        expected = inside(expected_cells(sensor, ends.tolist(), guarded, hit))
        assert free == expected
        assert hits == (inside(map(tuple, ends.tolist())) if hit else set())
        met += len(expected) > 0
    assert met > (200 if run == "compiled" else 4)


def test_columns_are_those_of_the_straight_line():
    rng = np.random.default_rng(8)
    for _ in range(300):
        sensor = (2 * rng.integers(0, 40 * 512, 3) + 1).tolist()
        end = tuple(rng.integers(0, 40, 3).tolist())
        crossed = naive_cells(sensor, end, False, False)
        assert {(x, y) for x, y, _ in crossed} == exact_columns(sensor, end)


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


@pytest.mark.parametrize("run", [kernels.place_ends, kernels.place_ends.py_func])
def test_place_ends(run):
    directions = np.repeat([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0]], 3, axis=0)
    ranges_mm = np.array([0, 100, 1000, 65535, 2001, 2000], np.uint16)
    ends, counts, listed = np.zeros(6, np.int64), np.zeros(4, np.int64), np.zeros(1, np.int64)
    box = np.array([[0, 1, 3], [0, 1, 3]])
    origin, groups = np.array([[0.05, 0.15, 0.25]]), np.array([0, 6])
    sensor, own = np.array([[256, 768, 1664]]), [[0, 1, 3]]
    args = (origin, sensor, groups, directions.reshape(-1), ranges_mm, (300, 2000), 0.1, (0, 6))
    args += ends, listed, box, counts, np.empty((4, kernels.CHUNK), np.int64)
    args += (np.empty(kernels.CHUNK, np.int64),)
    # -1.75 m is 16.75 cells below the floor's layer; two beams that only clear end there.
    told = [[10, 1, 3, 0, 0], [0, 1, -17, 1, 0], [0, 1, -17, 0, 0]]
    assert run(*args)
    assert listed.tolist() == [3]
    assert [unpacked(end, own) for end in ends[:3].tolist()] == told
    assert counts.tolist() == [2, 2, 1, 1]
    assert box.tolist() == [[0, 1, -17], [10, 1, 3]]
    directions[4, 1] = 1e-2
    assert not run(*args)


@pytest.mark.parametrize("run", [kernels.place_ends, kernels.place_ends.py_func])
def test_place_ends_of_many_origins_in_parts(run):
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
    counts, told = np.zeros(4, np.int64), []
    for part in ((0, 350), (350, 700)):
        ends, box = np.zeros(2 * 350, np.int64), np.zeros((2, 3), np.int64)
        listed = np.array([0, 350])
        assert run(
            *(origins, sensors, groups, directions.reshape(-1), ranges_mm, (300, 3000), 0.1),
            *(part, ends, listed, box, counts, np.empty((4, kernels.CHUNK), np.int64)),
            np.empty(kernels.CHUNK, np.int64),
        )
        for stripe, end in enumerate(listed):
            listed_ends = ends[350 * stripe : end].tolist()
            some = [unpacked(end, sensors // 512) for end in listed_ends]
            assert {row[0] // 8 % 2 for row in some} <= {stripe}
            assert [row[4] for row in some] == sorted(row[4] for row in some)
            assert all(np.all((box[0] <= r[:3]) & (r[:3] <= box[1])) for r in some)
            told += some
    other = np.any(np.diff(rows, axis=0) != 0, axis=1)
    assert {tuple(row) for row in told} == {tuple(row) for row in rows.tolist()}
    assert len(told) >= 1 + np.count_nonzero(other)
    fated = np.count_nonzero(fates[ranges_mm >= 300] == 0), np.count_nonzero(fates)
    dropped = np.count_nonzero(ranges_mm == 0)
    assert counts.tolist() == [*fated, dropped, 700 - sum(fated) - dropped]


@pytest.mark.parametrize("run", [carving.next_run, carving.next_run.py_func])
def test_next_run(run):
    rng = np.random.default_rng(1)
    for _ in range(200):
        low = int(rng.integers(0, 64))
        high = int(rng.integers(low, 64))
        bits = (2 ** (high + 1) - 2**low) | int(rng.integers(0, 2**20)) << (high + 2)
        with np.errstate(over="ignore"):
            assert run(np.uint64(bits & (2**64 - 1))) == (low, high)


@pytest.mark.parametrize("run", ["compiled", "python"])
def test_beams_that_are_cut_short_where_all_is_marked_cross_what_whole_ones_do(run, monkeypatch):
    rng = np.random.default_rng(11)
    shape, size = (48, 64, 2), np.array([48, 64, 128])
    cut = []
    slabs_of = carving.marked_slabs

    def noted(*args):
        cut.append(slabs_of(*args))
        return cut[-1]

    if run == "python":
        monkeypatch.setattr(carving, "marked_slabs", noted)
    for k in range(5 if run == "compiled" else 2):
        sensor = (2 * rng.integers(10 * 512, (size - 10) * 512) + 1).tolist()
        own = np.array(sensor) // HALVES
        # A room with a gap and a floor: near the sensor every cell is crossed many times.
        walls = np.array([(x, y) for x in range(48) for y in range(64) if x in (1, 46) or y == 62])
        ends = np.repeat(walls[rng.random(len(walls)) < 0.9], 24, axis=0)
        ends = np.column_stack([ends, own[2] + rng.integers(-20, 20, len(ends))])
        floor = np.column_stack([rng.integers(2, 46, 500), rng.integers(2, 62, 500)])
        floor = np.column_stack([floor, np.full(500, max(own[2] - 9, 0))])
        ends = np.unique(np.clip(np.vstack([ends, floor]), 0, size - 1), axis=0)
        ends = rng.permutation(ends)[: 3000 if run == "compiled" else 1200].tolist()
        free, _ = carve(run, sensor, ends, shape, int(max(own[2] - 9, 0)), bool(k % 2))
        assert free == expected_cells(sensor, ends, int(max(own[2] - 9, 0)), bool(k % 2))
    assert run == "compiled" or np.count_nonzero(cut) > 50
