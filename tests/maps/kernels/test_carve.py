"""Carving compiled and as Python, against slow walks straight from the definition."""

from fractions import Fraction

import numpy as np
import pytest

from tests.maps.naive_beams import HALVES, from_middle, naive_cells
from wayproof.maps.kernels import beam_targets, beams
from wayproof.maps.kernels import carve as kernels
from wayproof.maps.kernels.beam_columns import MAX_STEPS
from wayproof.maps.kernels.early_stop import SLOPES
from wayproof.maps.voxel.update_mask import SPREAD

OWN = beam_targets.OWN_LAYER


def packed(cell, origin_cell, fate):
    """An end as `pack_ends` writes it, of origin 0."""
    offsets = (int(a) - int(b) + beams.HALF_SPAN for a, b in zip(cell, origin_cell, strict=True))
    x, y, z = offsets
    return x << 26 | y << 13 | z | fate << 39


def carve(run, sensor, ends, shape, guarded=-1, hit=True, box=None):
    """Cells of the free marks for beams to the given ends, and those of the hits."""
    in_python = run == "python"
    list_targets, order_targets, carve_beams = (
        kernel.py_func if in_python else kernel
        for kernel in (beam_targets.list_targets, beam_targets.order_targets, kernels.carve)
    )
    own = [h // HALVES for h in sensor]
    nx, ny, words = shape
    box = box or (0, 0, 0, nx - 1, ny - 1, 64 * words - 1)
    window = beam_targets.Window(shape, box, guarded)
    hits, free, aims, grazes = (np.zeros(nx * ny * words, np.uint64) for _ in range(4))
    flags, (columns, ranks, order) = np.zeros(nx * ny, np.uint8), np.empty((3, len(ends)), np.int32)
    target_words, bits = np.empty((len(ends), 5), np.int32), np.empty(len(ends), np.uint64)
    wedges, sensors = np.empty((len(ends), 3), np.int64), np.array([sensor])
    starts = np.empty(beam_targets.SECTORS + 1, np.int64)
    packed_ends = np.array([packed(end, own, 0 if hit else 1) for end in ends], np.int64)
    groups = np.empty(2, np.int64)
    with np.errstate(over="ignore"):
        masks = beam_targets.EndMasks(hits, aims, grazes, flags, columns)
        targets = beam_targets.Targets(target_words, bits, ranks)
        list_targets(packed_ends, sensors, window, SPREAD, masks, targets, groups)
        used = order_targets(ranks, groups, starts, order, wedges)
        assert sorted(order[: groups[1]]) == list(range(groups[1]))
        assert wedges[:used, 0].tolist() == [0, *wedges[: used - 1, 1]]
        steps = MAX_STEPS + 1
        scratch = kernels.CarveScratch(
            *(np.empty(steps, np.int64) for _ in range(4)),
            marked=np.empty(SLOPES, np.int64),
            masks=np.empty(steps, np.uint64),
            runs=np.empty((kernels.MAX_RUNS * words, 3), np.int64),
        )
        carve_beams(targets, order, wedges[:used], sensors, window, scratch, free)
    assert not aims.any()
    assert not grazes.any()
    assert not flags.any()

    def cells(words_):
        bits = np.unpackbits(words_.view(np.uint8).reshape(nx, ny, -1), axis=2, bitorder="little")
        return {tuple(cell) for cell in np.argwhere(bits).tolist()}

    return cells(free), cells(hits)


@pytest.mark.few(1)
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
        guarded = (-1, int(run_of_ends[4, 2]), OWN)[k % 3]
        free, hits = carve(run, sensor, ends, shape, guarded, hit)
        assert free == expected_cells(sensor, ends, guarded, hit)
        assert hits == ({tuple(end) for end in ends} if hit else set())


def expected_cells(sensor, ends, guarded, hit):
    """Cells that beams cross, with the layer that they spare."""
    expected = set()
    if guarded == OWN:
        return set().union(*(naive_cells(sensor, tuple(end), hit, "own") for end in ends))
    for end in ends:
        shifted = [*sensor[:2], sensor[2] - HALVES * guarded]  # the floor's layer is layer 0
        crossed = naive_cells(shifted, (*end[:2], end[2] - guarded), hit, guarded >= 0)
        expected |= {(x, y, z + guarded) for x, y, z in crossed}
    return expected


@pytest.mark.few(1)
@pytest.mark.parametrize("run", ["compiled", "python"])
def test_of_beams_from_and_to_anywhere_the_cells_in_a_box_are_marked(run):
    rng = np.random.default_rng(5)
    shape, size = (16, 32, 2), np.array([16, 32, 128])
    met = 0
    count = 80 if run == "compiled" else 10
    for k in range(count):
        box = np.sort(rng.integers(0, size, (2, 3)), axis=0)
        wide = size + 40
        sensor = (2 * rng.integers(-40 * 512, wide * 512) + 1).tolist()
        ends = rng.integers(-40, wide, (12, 3))
        ends[:4] = rng.integers(box[0], box[1] + 1, (4, 3))
        ends[4:8, :2] = ends[:4, :2]  # above and below those in the box
        if k % 5 == 0:
            ends[:, :2] = ends[:1, :2] + np.arange(12)[:, None]  # diagonals meet edges
            sensor[1] = sensor[0] + HALVES * int(ends[0, 1] - ends[0, 0])
        hit, guarded = bool(k % 2), (-1, int(ends[k % 12, 2]), OWN)[k % 3]
        guarded = guarded if 0 <= guarded < 128 or guarded == OWN else -1
        limits = (*box[0].tolist(), *box[1].tolist())
        free, hits = carve(run, sensor, ends.tolist(), shape, guarded, hit, limits)

        def inside(cells, box=box):
            return {c for c in cells if np.all(box[0] <= c) and np.all(np.array(c) <= box[1])}

        expected = inside(expected_cells(sensor, ends.tolist(), guarded, hit))
        assert free == expected
        assert hits == (inside(map(tuple, ends.tolist())) if hit else set())
        met += len(expected) > 0
    assert met > 0.4 * count


def exact_columns(sensor, end):
    """The columns on the straight line, by fractions, where it meets no edge."""
    to_sensor = from_middle(sensor, end)
    columns, x, y = {(end[0], end[1])}, end[0], end[1]
    faces = []
    for axis in range(2):
        for k in range(abs(sensor[axis] // HALVES - end[axis])):
            faces.append((Fraction((2 * k + 1) * HALVES, 2 * abs(to_sensor[axis])), axis))
    for _, axis in sorted(faces):
        x += (axis == 0) * (1 if to_sensor[0] > 0 else -1)
        y += (axis == 1) * (1 if to_sensor[1] > 0 else -1)
        columns.add((x, y))
    return columns


def test_columns_are_those_of_the_straight_line():
    rng = np.random.default_rng(8)
    for _ in range(300):
        sensor = (2 * rng.integers(0, 40 * 512, 3) + 1).tolist()
        end = tuple(rng.integers(0, 40, 3).tolist())
        crossed = naive_cells(sensor, end, False, False)
        assert {(x, y) for x, y, _ in crossed} == exact_columns(sensor, end)


@pytest.mark.few(1)
@pytest.mark.parametrize("run", ["compiled", "python"])
def test_beams_that_are_cut_short_where_all_is_marked_cross_what_whole_ones_do(run, monkeypatch):
    rng = np.random.default_rng(11)
    shape, size = (48, 64, 2), np.array([48, 64, 128])
    cut = []
    slabs_of = kernels.marked_slabs

    def noted(*args):
        cut.append(slabs_of(*args))
        return cut[-1]

    if run == "python":
        monkeypatch.setattr(kernels, "marked_slabs", noted)
    for k in range(2):
        sensor = (2 * rng.integers(10 * 512, (size - 10) * 512) + 1).tolist()
        own = np.array(sensor) // HALVES
        # A room with a gap and a floor: near the sensor every cell is crossed many times.
        walls = np.array([(x, y) for x in range(48) for y in range(64) if x in (1, 46) or y == 62])
        ends = np.repeat(walls[rng.random(len(walls)) < 0.9], 24, axis=0)
        ends = np.column_stack([ends, own[2] + rng.integers(-20, 20, len(ends))])
        floor = np.column_stack([rng.integers(2, 46, 500), rng.integers(2, 62, 500)])
        floor = np.column_stack([floor, np.full(500, max(own[2] - 9, 0))])
        ends = np.unique(np.clip(np.vstack([ends, floor]), 0, size - 1), axis=0)
        ends = rng.permutation(ends)[:1200].tolist()
        free, _ = carve(run, sensor, ends, shape, int(max(own[2] - 9, 0)), bool(k % 2))
        assert free == expected_cells(sensor, ends, int(max(own[2] - 9, 0)), bool(k % 2))
    assert run == "compiled" or np.count_nonzero(cut) > 50
