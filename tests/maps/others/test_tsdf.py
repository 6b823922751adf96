import math
from fractions import Fraction

import numpy as np
import pytest

from tests.maps.sweeps import floor_scan, scattered
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, MapConfig, TsdfMap, states_in

SECOND = 10**9
FORWARD = np.array([[1.0, 0.0, 0.0]])
EYE = (0.55, 1.05, 0.475)  # the middle of a cell


def make(**settings):
    return TsdfMap(MapConfig(**({"half_life": 0.0, "memory_mib": 16} | settings)))


def look(tsdf, *ranges_mm, directions=None, origin=EYE, time_ns=0, limit=3.0, **spared):
    directions = np.repeat(FORWARD, len(ranges_mm), 0) if directions is None else directions
    ranges_mm = np.array(ranges_mm, np.uint16)
    return tsdf.integrate(origin, np.array(directions, float), ranges_mm, limit, time_ns, **spared)


def along_x(*cells):
    """Centres of cells ahead of the eye, whose own is 0."""
    return np.array(EYE) + np.array(cells)[:, None] * [0.1, 0.0, 0.0]


def test_one_beam_by_hand():
    tsdf = make()
    statistics = look(tsdf, 2000)
    assert (statistics.hits, statistics.cells_updated) == (1, 24)  # 4 cells beyond weigh nothing
    at = along_x(0, 16, 17, 18, 19, 20, 21, 22, 23, 24)
    expected = [0.4, 0.4, 0.3, 0.2, 0.1, 0.0, -0.1, -0.2, -0.3, math.nan]
    np.testing.assert_allclose(tsdf.distance_at(at), expected, atol=1e-12)
    # 0.1 m is more than half a diagonal, 0.087 m.
    states = [FREE] * 5 + [OCCUPIED] * 4 + [UNKNOWN]
    assert tsdf.state_at(at).tolist() == states
    # Weights 8, and behind one cell 8 * 512 // 768 = 5 and 8 * 256 // 768 = 2, of 8 a sweep.
    sure = [0.5 * w / (w + 8) for w in (8, 8, 5, 2, 0)]
    np.testing.assert_allclose(tsdf.probability_at(at)[-5:] - 0.5, sure)
    assert tsdf.probability_at(at)[0] == 0.25
    assert tsdf.counts() == {"free": 20, "occupied": 4}


def test_two_sweeps_are_averaged_by_weight():
    tsdf = make()
    look(tsdf, 2000)
    look(tsdf, 2100)
    # Cell 20: 0 and 256 units; 21: -256 and 0; 22: -512 with 5 and -256 with 8; 24: -768 with 2.
    expected = [128, -128, round((-512 * 5 - 256 * 8) / 13), -768]
    got = tsdf.distance_at(along_x(20, 21, 22, 24)) * 2560
    np.testing.assert_allclose(got, expected, atol=1e-9)
    assert tsdf.state_at(along_x(20)).tolist() == [OCCUPIED]


def test_what_has_gone_is_free_after_a_few_sweeps_however_often_it_was_seen():
    tsdf = make()
    for _ in range(40):
        look(tsdf, 2000)
    assert tsdf.probability_at(along_x(20))[0] == 0.5 + 0.5 * 15 / 16  # at most 15 sweeps
    sweeps = 0
    while tsdf.state_at(along_x(20))[0] == OCCUPIED:
        look(tsdf, 2900)
        sweeps += 1
    # 1024 (1 - (15/16)^n) > 221: n = 4 by hand, all but rounding: 64, 124, 180, 233 units.
    assert sweeps == 4


def test_a_beam_without_return_clears_and_makes_no_surface():
    tsdf = make()
    look(tsdf, 65535)
    assert tsdf.counts() == {"free": 31, "occupied": 0}
    assert look(tsdf, 0, 299).cells_updated == 0


def test_a_surface_wins_over_beams_that_pass_it_in_the_same_sweep():
    tsdf = make()
    for _ in range(5):
        look(tsdf, 2000, 2900)
    assert tsdf.state_at(along_x(20, 21)).tolist() == [OCCUPIED, FREE]  # 21 was passed as well


def test_beams_are_merged_to_the_mean_of_their_ends():
    tsdf, single = make(), make()
    look(tsdf, 1960, 2040)
    look(single, 2000)
    at = along_x(18, 19, 20, 21, 22)
    np.testing.assert_allclose(tsdf.distance_at(at), single.distance_at(at), atol=0.1 / 256 + 1e-9)
    assert tsdf.counts() == single.counts()


def naive_crossed(start, end, cells):
    """Whether a segment crosses the inside of cells (n, 3), and whether it is beyond doubt."""
    way = (end - start).astype(float)
    enter, leave = np.zeros(len(cells)), np.ones(len(cells))
    for axis in range(3):
        if way[axis] == 0:
            miss = cells[:, axis] != start[axis] >> 10
            leave[miss] = -1.0
            continue
        faces = (cells[:, axis, None] * 1024 + [0, 1024] - start[axis]) / way[axis]
        enter = np.maximum(enter, faces.min(axis=1))
        leave = np.minimum(leave, faces.max(axis=1))
    return leave - enter > 1e-9, np.abs(leave - enter) > 1e-9


def naive_sweep(origin, directions, ranges_mm, cells):
    """Scores of a sweep in cells (n, 3): the best (distance, weight), and where doubtful."""
    start = np.floor(np.array(origin) * 5120).astype(int) + np.array([0, 0, 384])
    groups = {}
    for direction, millimetres in zip(directions, ranges_mm.tolist(), strict=True):
        end = np.floor((np.array(origin) + direction * (millimetres / 1000)) * 5120).astype(int)
        end += [0, 0, 384]
        groups.setdefault(tuple(end // 512), []).append(end)
    best, doubt = {}, np.zeros(len(cells), bool)
    for ends in groups.values():
        first, last = 2 * start + 1, 2 * (np.sum(ends, axis=0) // len(ends)) + 1
        way = last - first
        length = math.isqrt(int(way @ way))
        beyond = (last + 4096 * way // length) | 1
        crossed, sure = naive_crossed(first, beyond, cells)
        doubt |= ~sure
        for i in np.flatnonzero(crossed).tolist():
            dot = int((last - cells[i] * 1024 - 512) @ way)
            distance = min(math.floor(Fraction(dot, 4 * length)), 1024)
            weight = 8 if distance >= -256 else 8 * (distance + 1024) // 768
            if distance > -1024 and weight > 0:
                candidate = (distance < -222, abs(distance), distance > 0, distance, weight)
                best[i] = min(best.get(i, candidate), candidate)
    return best, doubt


def test_sweeps_are_those_of_a_naive_field():
    cells = np.moveaxis(np.indices((44, 44, 44)), 0, -1).reshape(-1, 3) - 22
    tsdf = make(minimum_range=0.0)
    held = {i: (0, 0) for i in range(len(cells))}
    doubt = np.zeros(len(cells), bool)
    for seed in range(2):
        directions, ranges_mm = scattered(np.random.default_rng(seed), 25, 300, 1600)
        origin = np.random.default_rng(seed).uniform(-0.2, 0.2, 3)
        look(tsdf, *ranges_mm, directions=directions, origin=origin, spared="none")
        best, unsure = naive_sweep(origin, directions, ranges_mm, cells)
        doubt |= unsure
        for i, (*_, distance, weight) in best.items():
            before, weight_before = held[i]
            both = weight_before + weight
            mean = Fraction(before * weight_before + distance * weight, both)
            held[i] = math.floor(mean + Fraction(1, 2)), min(both, 120)
    points = (cells + 0.5) * 0.1 - [0.0, 0.0, 0.075]
    distances = np.array([held[i][0] / 2560 if held[i][1] else math.nan for i in held])
    assert np.count_nonzero(~np.isnan(distances)) > 500
    assert doubt.mean() < 0.01
    np.testing.assert_allclose(tsdf.distance_at(points)[~doubt], distances[~doubt], atol=1e-12)


def test_a_flat_floor_seen_while_walking_stays_whole_and_free_above():
    directions, ranges_mm = floor_scan(0.42)
    tsdf = make(memory_mib=64)
    ever_hit = np.zeros((180, 180), bool)
    box = (-9.0, -9.0, -0.07), (9.0, 9.0, 0.12)
    for k in range(11):
        look(tsdf, *ranges_mm, directions=directions, origin=(0.1 * k, 0, 0.42), limit=8.0)
        ever_hit |= states_in(tsdf, *box)[:, :, 0] == OCCUPIED
    floor, above = np.moveaxis(states_in(tsdf, *box), 2, 0)
    assert ever_hit.sum() > 2000
    assert np.all(floor[ever_hit] == OCCUPIED)
    assert not np.any(above == OCCUPIED)


def test_weights_fade_by_the_half_life_and_the_distance_stays():
    tsdf = make(half_life=1.0)  # halves with every tick
    look(tsdf, 2000, time_ns=100)
    tsdf.advance(SECOND)  # fresh: seen since the tick before
    assert tsdf.probability_at(along_x(20))[0] == 0.75
    weights = []
    for k in range(2, 12):
        tsdf.advance(k * SECOND)
        sure = 2.0 * (tsdf.probability_at(along_x(20))[0] - 0.5)
        weights.append(round(8 * sure / (1 - sure)))
        if weights[-1] > 0:
            assert tsdf.distance_at(along_x(20))[0] == 0.0
    assert weights == sorted(weights, reverse=True)
    assert weights[0] in (3, 4, 5)
    assert weights[-1] == 0


def test_marks_are_distances():
    tsdf = make()
    look(tsdf, 2000)
    tsdf.mark_free((2.4, 0.9, 0.4), (2.8, 1.2, 0.6), 3)
    tsdf.mark_floor((1.0, 1.0), (1.2, 1.2), 7)
    at = [*along_x(20), [2.55, 1.15, 0.475], [1.05, 1.05, 0.0]]
    assert tsdf.distance_at(at).tolist() == [0.0, 0.4, 0.0]


def test_too_large_a_sweep_is_refused():
    with pytest.raises(ValueError, match="expected at most 536870912: a shorter range or coarser"):
        look(
            make(resolution=0.01),
            20000,
            20000,
            20000,
            limit=20.4,
            directions=[[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]],
        )
