import math

import numpy as np
import pytest

from tests.maps.kernels.test_decay import naive_tick
from wayproof.maps import UNKNOWN, MapConfig, VoxelMap

SECOND = 10**9
EYE = (0.55, 0.55, 0.475)
WALL = [[2.55, 0.55, 0.475]]
SIDE = [[0.55, 2.55, 0.475]]
FORWARD, LEFT = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


def make(half_life=30.0, **settings):
    return VoxelMap(MapConfig(half_life=half_life, **settings))


def look(voxel_map, direction, time_ns):
    beams, ranges_mm = np.array([direction]), np.array([2000], np.uint16)
    voxel_map.integrate(EYE, beams, ranges_mm, 3.0, time_ns)


def log_odds(voxel_map, point):
    """In units of 1/30, by way of the probability."""
    odds = float(voxel_map.probability_at(point)[0])
    return round(30.0 * math.log(odds / (1.0 - odds)))


@pytest.mark.parametrize("half_life", [1.0, 4.0, 30.0])
def test_lazy_decay_is_eager_decay(half_life):
    """Asked only at the end, or after every tick: the same; and cell by cell what ticks make."""
    share = 1.0 - 2.0 ** (-1.0 / half_life)
    rng = np.random.default_rng(2)
    lazy, eager = make(half_life), make(half_life)
    naive, fresh = {}, set()
    tick = 0
    for k in range(60):
        time_ns = k * 700_000_000
        for now in range(tick + 1, time_ns // SECOND + 1):
            eager.advance(now * SECOND)
            eager.state_at(WALL)
            for cell in set(naive) - fresh:
                value = naive_tick([abs(naive[cell])], now - 1, share)[0]
                naive[cell] = value if naive[cell] > 0 else -value
            fresh, tick = set(), now
        if k % 13 < 4:
            direction = (FORWARD, LEFT)[int(rng.integers(0, 2))]
            look(lazy, direction, time_ns)
            look(eager, direction, time_ns)
            for step in range(21):
                cell = tuple(5 + step * int(d) for d in direction[:2])
                fresh.add(cell)
                old = naive.get(cell, 0)
                naive[cell] = min(old + 27, 104) if step == 20 else max(old - 12, -60)
        lazy.advance(time_ns)
        eager.advance(time_ns)
        cells = sorted(naive)
        points = [[0.05 + 0.1 * x, 0.05 + 0.1 * y, 0.475] for x, y in cells]
        expected = [naive[cell] for cell in cells]
        if k % 7 == 0:
            assert [log_odds(eager, [point]) for point in points] == expected
            signs = [0 if v == 0 else (1 if v < 0 else 2) for v in expected]
            assert eager.state_at(points).tolist() == signs
        if k % 20 == 19:
            assert [log_odds(lazy, [point]) for point in points] == expected
            assert lazy.version() == eager.version()
            known = {"free": sum(v < 0 for v in expected), "occupied": sum(v > 0 for v in expected)}
            assert lazy.counts() == known


def test_a_tick_leaves_the_fresh_and_fades_the_rest_by_hand():
    voxel_map = make(half_life=1.0)  # halves with every tick
    look(voxel_map, FORWARD, 100)
    voxel_map.advance(SECOND)  # fresh: seen since the tick before
    assert log_odds(voxel_map, WALL) == 27
    seen = []
    for k in range(2, 10):
        voxel_map.advance(k * SECOND)
        seen.append((log_odds(voxel_map, WALL), log_odds(voxel_map, [EYE])))
    # Half of 27 is 13.5, and n phi mod 1 is 0.618 for n = 1: it takes floor(14.118). Then 0.236,
    # 0.854, 0.472, 0.090, 0.708.
    assert [hit for hit, _ in seen] == [13, 7, 3, 2, 1, 0, 0, 0]
    assert [miss for _, miss in seen] == [-6, -3, -1, -1, -1, 0, 0, 0]
    assert voxel_map.counts() == {"free": 0, "occupied": 0}


def test_zero_half_life_is_no_decay():
    voxel_map = make(half_life=0.0)
    look(voxel_map, FORWARD, 0)
    before = voxel_map.version()
    voxel_map.advance(10_000 * SECOND)
    assert voxel_map.version() == before


def test_a_tick_lies_at_the_multiple_of_its_period():
    voxel_map = make(half_life=1.0, decay_period=0.5)
    look(voxel_map, FORWARD, 0)
    voxel_map.advance(SECOND // 2)  # fresh
    voxel_map.advance(SECOND - 1)
    assert log_odds(voxel_map, WALL) == 27
    voxel_map.advance(SECOND)
    assert log_odds(voxel_map, WALL) == 27 - 8  # floor(27 - 27 / sqrt(2) + 0.618)


def test_a_long_silence_costs_nothing_once_all_is_forgotten():
    voxel_map = make(half_life=1.0)
    look(voxel_map, FORWARD, 0)
    voxel_map.advance(10**18)  # thirty years
    look(voxel_map, FORWARD, 10**18 + 1)
    assert log_odds(voxel_map, WALL) == 27


def test_what_is_held_is_not_forgotten_and_nothing_else():
    voxel_map = make(half_life=3.0)
    look(voxel_map, FORWARD, 0)
    look(voxel_map, LEFT, 0)
    seen = voxel_map.counts()
    for k in range(1, 60):
        voxel_map.exempt_from_decay((2.0, 0.4, 0.4), (2.7, 0.7, 0.5), k * SECOND + 1)
    assert log_odds(voxel_map, WALL) == 27
    assert log_odds(voxel_map, [[2.05, 0.55, 0.475]]) == -12
    assert voxel_map.state_at([*SIDE, EYE]).tolist() == [UNKNOWN] * 2
    assert seen["free"] == 39
    assert voxel_map.counts() == {"free": 5, "occupied": 1}
    voxel_map.exempt_from_decay(
        (50.0, 0.0, 0.0), (51.0, 1.0, 1.0), 60 * SECOND
    )  # nothing is known there
    for k in range(61, 120):
        voxel_map.advance(k * SECOND)
    assert voxel_map.counts() == {"free": 0, "occupied": 0}
