import numpy as np
import pytest

from maps import OCCUPIED, UNKNOWN, MapConfig, VoxelMap

SECOND = 10**9
EYE = (0.55, 0.55, 0.475)
WALL = [[2.55, 0.55, 0.475]]
SIDE = [[0.55, 2.55, 0.475]]
FORWARD, LEFT = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


def make(half_life=30.0, **settings):
    config = MapConfig(half_life=half_life, **settings)
    return VoxelMap(config, (0.0, 0.0, -0.075), (3.0, 3.0, 0.925))


def look(voxel_map, direction, time_ns):
    beams, ranges_mm = np.array([direction]), np.array([2000], np.uint16)
    voxel_map.integrate(EYE, beams, ranges_mm, 3.0, time_ns)


def log_odds(voxel_map, point):
    return int(voxel_map.log_odds[tuple(voxel_map.grid.indices(point)[0][0])])


def test_a_tick_leaves_the_fresh_and_fades_the_rest_by_hand():
    voxel_map = make(half_life=1.0)  # halves with every tick
    look(voxel_map, FORWARD, 100)
    voxel_map.advance(SECOND)  # fresh: seen since the tick before
    assert log_odds(voxel_map, WALL) == 900
    seen = []
    for k in range(2, 12):
        voxel_map.advance(k * SECOND)
        seen.append((log_odds(voxel_map, WALL), int(voxel_map.log_odds.min())))
    # Toward zero on both sides: 225 / 2 is 112, and -25 / 2 is -12.
    assert [hit for hit, _ in seen] == [450, 225, 112, 56, 28, 14, 7, 3, 1, 0]
    assert [miss for _, miss in seen] == [-200, -100, -50, -25, -12, -6, -3, -1, 0, 0]
    assert voxel_map.counts()["unknown"] == voxel_map.log_odds.size


def test_the_half_life_holds_within_rounding():
    voxel_map = make()
    for _ in range(4):
        look(voxel_map, FORWARD, 0)
    before = log_odds(voxel_map, WALL)
    voxel_map.advance(31 * SECOND)  # one tick while fresh, then thirty
    assert before == 3476
    assert log_odds(voxel_map, WALL) == pytest.approx(before / 2, rel=0.02)


def test_decay_reaches_unknown():
    voxel_map = make()
    look(voxel_map, FORWARD, 0)
    voxel_map.advance(600 * SECOND)
    assert voxel_map.state_at(WALL).tolist() == [UNKNOWN]
    assert voxel_map.version() == make().version()


def test_what_is_seen_between_ticks_does_not_decay():
    voxel_map = make()
    look(voxel_map, FORWARD, 0)
    look(voxel_map, LEFT, 0)
    for k in range(200):
        look(voxel_map, FORWARD, k * SECOND + SECOND // 2)
    assert log_odds(voxel_map, WALL) == 3476
    assert voxel_map.state_at([*WALL, *SIDE]).tolist() == [OCCUPIED, UNKNOWN]


def test_zero_half_life_is_no_decay():
    voxel_map = make(half_life=0.0)
    look(voxel_map, FORWARD, 0)
    before = voxel_map.version()
    voxel_map.advance(10_000 * SECOND)
    assert voxel_map.version() == before


def test_the_schedule_does_not_depend_on_the_calls():
    once, often = make(), make()
    for k in range(12):
        time_ns = k * 700_000_000
        look(once, FORWARD if k % 3 else LEFT, time_ns)
        for fraction in range(0, 700_000_000, 50_000_000):
            often.advance(max(0, time_ns - 700_000_000 + fraction))
        look(often, FORWARD if k % 3 else LEFT, time_ns)
        assert once.version() == often.version()
    once.advance(40 * SECOND)
    for k in range(40 * 4 + 1):
        often.advance(k * SECOND // 4)
    assert once.version() == often.version()
    assert once.log_odds.any()


def test_a_tick_lies_at_the_multiple_of_its_period():
    voxel_map = make(half_life=1.0, decay_period=0.5)
    look(voxel_map, FORWARD, 0)
    voxel_map.advance(SECOND // 2)  # fresh
    voxel_map.advance(SECOND - 1)
    assert log_odds(voxel_map, WALL) == 900
    voxel_map.advance(SECOND)
    assert log_odds(voxel_map, WALL) == 636  # 900 / sqrt(2)


def test_a_long_silence_costs_nothing_once_all_is_forgotten():
    voxel_map = make(half_life=1.0)
    look(voxel_map, FORWARD, 0)
    voxel_map.advance(10**18)  # thirty years
    look(voxel_map, FORWARD, 10**18 + 1)
    assert log_odds(voxel_map, WALL) == 900


def test_time_starts_at_zero():
    with pytest.raises(ValueError, match="time_ns: got -1"):
        make().advance(-1)
