"""What moves: cells by hand, and kernels against slow truths."""

from itertools import product

import numpy as np
import pytest

from tests.maps.cells import occupied_centres
from wayproof.maps import (
    FREE,
    MAPS,
    OCCUPIED,
    DynamicConfig,
    DynamicMap,
    MapConfig,
    VoxelMap,
    states_in,
)
from wayproof.maps.others.ever_free import EverFreeSpace
from wayproof.maps.others.tracking import POINTS, Traffic, way_ahead

TENTH = 100_000_000  # ns
ORIGIN = (0.05, 0.55, 0.55)  # cell (0, 5, 6)
ALONG_X = np.array([[1.0, 0.0, 0.0]])
LOW, HIGH = (-3.0, -3.0, -3.0), (3.0, 3.0, 3.0)
NOTHING = 0  # mm: a dropped beam
AT_ONCE = DynamicConfig(flag_on_first_hit=True)
AHEAD = np.array([[1.05, 0.55, 0.55]])  # in cell (10, 5, 6)


def confident(kind="dynamic", **settings):
    """A map whose block from the origin to (3, 1.2, 1.2) has been free for long, and the time."""
    dynamic = DynamicConfig(**({"flag_on_first_hit": True} | settings))
    config = MapConfig(kind=kind, half_life=0.0, memory_mib=8, dynamic=dynamic)
    voxel_map = MAPS[kind](config)
    for _ in range(5):  # 5 misses of 12 units: at the lower clamp, -60
        voxel_map.mark_free((0.0, 0.0, 0.0), (3.0, 1.2, 1.2), 0)
    for k in range(11):
        beam(voxel_map, NOTHING, k)
    return voxel_map, 11


def beam(voxel_map, range_mm, k, direction=ALONG_X, limit=2.5):
    ranges_mm = np.array([range_mm], np.uint16)
    return voxel_map.integrate(ORIGIN, direction, ranges_mm, limit, k * TENTH)


def sweeps_until(voxel_map, k, range_mm, state):
    """Number of beams of one range until the cell ahead is in a state."""
    for count in range(1, 30):
        beam(voxel_map, range_mm, k + count)
        if voxel_map.state_at(AHEAD)[0] == state:
            return count
    return None


@pytest.mark.parametrize(("kind", "entered", "left"), [("voxel", 3, 9), ("dynamic", 1, 2)])
def test_sweeps_until_a_cell_is_occupied_and_until_it_is_free_again(kind, entered, left):
    voxel_map, k = confident(kind)
    assert voxel_map.state_at(AHEAD)[0] == FREE
    # Voxel: -60, then -33, -6, 21 units of 27 a hit.
    assert sweeps_until(voxel_map, k, 1000, OCCUPIED) == entered
    for j in range(6):
        beam(voxel_map, 1000, k + entered + j)
    # At the upper clamp, 104 units, 12 a miss: 9 take it to -4.
    assert sweeps_until(voxel_map, k + entered + 6, 2000, FREE) == left


def test_a_hit_between_two_crossings_keeps_the_cell():
    voxel_map, k = confident(prediction_horizon=0.0)
    seen = []
    for j in range(10):
        beam(voxel_map, 1000 if j % 2 == 0 else 2000, k + j)
        seen.append(int(voxel_map.state_at(AHEAD)[0]))
    assert seen == [OCCUPIED] * 10


def test_what_stays_is_of_the_surroundings_and_noise_beside_it_is_no_motion():
    voxel_map, k = confident()
    for j in range(20):
        beam(voxel_map, 1000, k + j)
        assert len(voxel_map.dynamic_centres()) == 1
    beam(voxel_map, 1000, k + 20)  # 2 s after the first
    assert len(voxel_map.dynamic_centres()) == 0
    assert voxel_map.state_at(AHEAD)[0] == OCCUPIED
    beam(voxel_map, 900, k + 21)
    assert len(voxel_map.dynamic_centres()) == 0
    assert sweeps_until(voxel_map, k + 21, 2000, FREE) == 9


def test_every_query_agrees_on_a_dynamic_cell():
    voxel_map, k = confident()
    before = voxel_map.counts(), voxel_map.version()
    beam(voxel_map, 1000, k)
    np.testing.assert_allclose(voxel_map.dynamic_centres(), [[1.05, 0.55, 0.575]])
    np.testing.assert_allclose(occupied_centres(voxel_map, LOW, HIGH), [[1.05, 0.55, 0.575]])
    states = states_in(voxel_map, (1.0, 0.5, 0.525), (1.1, 0.6, 0.625))
    assert states.tolist() == [[[OCCUPIED]]]
    occupied, free = voxel_map.columns((10, 5, 0), (1, 1, 1))
    assert int(occupied[0, 0, 0]) == 1 << 6
    assert not int(free[0, 0, 0]) & 1 << 6
    assert voxel_map.counts()["occupied"] == before[0]["occupied"] + 1 == 1
    assert voxel_map.counts()["free"] == before[0]["free"] - 1
    assert voxel_map.version() != before[1]
    end = voxel_map.cast_ray(ORIGIN, (2.0, 0.0, 0.0), 2.0)
    assert end.state == OCCUPIED
    assert end.distance == pytest.approx(0.95)
    assert voxel_map.cast_ray(ORIGIN, (1.0, 0.0, 0.0), 0.95, stop_at_unknown=True) is not None
    assert voxel_map.cast_ray(ORIGIN, (1.0, 0.0, 0.0), 0.9) is None
    assert voxel_map.cast_ray(ORIGIN, (1.0, 0.1, 0.0), 0.9) is None
    # The lasting evidence is that of one hit: -60 + 27 of 30 units to one of log-odds.
    assert voxel_map.probability_at(AHEAD)[0] == pytest.approx(1.0 / (1.0 + np.exp(33.0 / 30.0)))


def test_every_query_agrees_on_a_vacated_cell():
    voxel_map, k = confident()
    for j in range(7):
        beam(voxel_map, 1000, k + j)
    for j in range(2):
        beam(voxel_map, 2000, k + 7 + j)
    assert VoxelMap.state_at(voxel_map, AHEAD)[0] == OCCUPIED
    assert voxel_map.state_at(AHEAD)[0] == FREE
    occupied, free = voxel_map.columns((10, 5, 0), (1, 1, 1))
    assert int(occupied[0, 0, 0]) == 0
    assert int(free[0, 0, 0]) & 1 << 6
    # The second beam's end, 2 m on, was in confident space as well.
    np.testing.assert_allclose(occupied_centres(voxel_map, LOW, HIGH), [[2.05, 0.55, 0.575]])
    assert voxel_map.counts()["occupied"] == 1
    end = voxel_map.cast_ray(ORIGIN, (1.0, 0.0, 0.0), 3.0)
    assert end.distance == pytest.approx(1.95)
    assert voxel_map.cast_ray(ORIGIN, (1.0, 0.0, 0.0), 0.95, stop_at_unknown=True) is None


def test_a_cell_that_was_hit_within_the_period_is_not_dynamic():
    config = MapConfig(kind="dynamic", half_life=0.0, memory_mib=8, dynamic=AT_ONCE)
    voxel_map = DynamicMap(config)
    for _ in range(5):
        voxel_map.mark_free((0.0, 0.0, 0.0), (3.0, 1.2, 1.2), 0)
    for k in range(11):
        beam(voxel_map, 1000 if k == 7 else NOTHING, k)
    assert voxel_map.state_at(AHEAD)[0] == FREE  # -33 units
    for range_mm in (900, 1000, 1100):  # nor are its neighbours
        beam(voxel_map, range_mm, 11)
    assert len(voxel_map.dynamic_centres()) == 0
    beam(voxel_map, 1200, 11)
    assert len(voxel_map.dynamic_centres()) == 1


def test_a_cell_beside_something_is_not_dynamic():
    voxel_map, k = confident()
    beam(voxel_map, 2900, k, limit=3.0)  # cell 29, beside what nobody has seen
    assert len(voxel_map.dynamic_centres()) == 0
    beam(voxel_map, 2800, k + 1, limit=3.0)
    np.testing.assert_allclose(voxel_map.dynamic_centres(), [[2.85, 0.55, 0.575]])


def test_the_motion_of_an_object_is_predicted_in_whole_cells():
    traffic, ahead = Traffic(0.1, 2 * TENTH), []
    for k in range(4):
        wall = np.array([[k + 5, y, z] for y, z in product(range(3), range(3))])
        moving, ahead = traffic.follow(wall, k * TENTH)
        assert len(moving) == (0 if k < 2 else 9)
        assert (len(ahead) > 0) == (k >= 2)
    assert [track.number for track in traffic.tracks] == [0]
    assert traffic.tracks[0].shift(10 * TENTH) == (10 * POINTS, 0, 0)  # 1 m/s
    expected = {(x, y, z) for x in (9, 10) for y in range(3) for z in range(3)}
    assert set(map(tuple, ahead.tolist())) == expected


def test_no_motion_to_and_fro_or_of_a_large_object_is_predicted():
    for step, width in ((lambda k: 3 * (k % 2), 3), (lambda k: k, 45)):
        traffic = Traffic(0.1, 2 * TENTH)
        for k in range(6):
            wall = np.array([[step(k), y, 0] for y in range(width)])
            moving, ahead = traffic.follow(wall, k * TENTH)
            assert len(moving) == len(ahead) == 0


def test_what_hangs_on_to_something_is_not_held_to_move():
    traffic, sizes = Traffic(0.1, TENTH), []
    for k in range(4):
        wall = np.array([[k, y, 0] for y in range(4)])
        moving, _ = traffic.follow(wall, k * TENTH, lambda part: sizes.append(len(part)))
        assert len(moving) == 0
    assert sizes == [4, 4]  # once it has come two cells far


def test_only_what_was_seen_to_move_is_dynamic():
    moved, stays = confident(flag_on_first_hit=False), confident(flag_on_first_hit=False)
    up = np.stack([np.ones(5), np.zeros(5), np.linspace(-0.2, 0.2, 5)], axis=1)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    seen = []
    for (voxel_map, k), step in ((moved, 100), (stays, 0)):
        for j in range(7):
            flat = 1400 + step * j
            ranges_mm = np.rint(flat / up[:, 0]).astype(np.uint16)
            voxel_map.integrate(ORIGIN, up, ranges_mm, 2.5, (k + j) * TENTH)
            seen.append(len(voxel_map.dynamic_centres()) > 0)
    assert not any(seen[:2])
    assert seen[6]
    assert not any(seen[7:])


def test_two_things_that_pass_keep_their_velocities():
    traffic = Traffic(0.1, TENTH)
    for k in range(20):
        pair = [[k, y, 0] for y in range(3)] + [[19 - k, y, 0] for y in range(8, 11)]
        traffic.follow(np.array(sorted(pair)), k * TENTH)
    assert [(t.number, t.shift(10 * TENTH)[0]) for t in traffic.tracks] == [
        (0, 10 * POINTS),
        (1, -10 * POINTS),
    ]


def test_a_thing_that_jumps_farther_than_the_gate_is_another_one():
    traffic = Traffic(0.1, TENTH)
    traffic.follow(np.array([[0, 0, 0]]), 0)
    traffic.follow(np.array([[6, 0, 0]]), TENTH)  # 5 m/s and a cell: 6 cells
    assert [t.number for t in traffic.tracks] == [0]
    traffic.follow(np.array([[19, 0, 0]]), 2 * TENTH)  # expected at 12, 7 from there
    assert [t.number for t in traffic.tracks] == [0, 1]
    traffic.follow(np.empty((0, 3), np.int64), 9 * TENTH)
    assert traffic.tracks == ()


def test_the_way_ahead_by_hand():
    cells = np.array([[0, 0, 0], [0, 1, 0]])
    ahead = way_ahead(cells, (3 * POINTS, -3 * POINTS // 2, 100))
    # Steps of 1, -1/2, and 1/30 cells; halves are rounded up.
    assert ahead.tolist() == [[1, 0, 0], [1, 1, 0], [2, -1, 0], [2, 0, 0], [3, -1, 0], [3, 0, 0]]
    assert len(way_ahead(cells, (0, 0, 0))) == 0


def test_confidence_needs_a_period_and_every_neighbour():
    space, key = EverFreeSpace(), np.zeros((1, 3), np.int64)
    full = np.full((1, 256), np.uint64(2**64 - 1))
    none = np.empty((0, 3), np.int64)
    middle, edge = np.array([[8, 8, 8]]), np.array([[0, 8, 8]])
    space.keep_free(key, full, none)
    space.close_period(lambda keys: np.repeat(full, len(keys), axis=0))
    assert not space.contains(middle)[0]
    space.close_period(lambda keys: np.repeat(full, len(keys), axis=0))
    assert space.contains(middle)[0]
    assert not space.contains(edge)[0]  # its neighbours were never seen
    digest = space.digest()
    space.remove(middle, middle + np.array([1, 0, 0]))
    seen = space.contains(middle + np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 2, 0]]))
    assert seen.tolist() == [False, True, False, True]
    assert space.digest() != digest
    space.keep_free(key, np.zeros((1, 256), np.uint64), none)
    space.close_period(lambda keys: np.zeros((len(keys), 256), np.uint64))
    assert len(space.keys()) == 0
    assert space.digest() == EverFreeSpace().digest()


@pytest.mark.parametrize(
    ("field", "value", "expected"),
    [
        ("burn_in", 0.0, r"0\.01 to 3600 s"),
        ("free_after_misses", 0, "1 to 1000 sweeps"),
        ("static_after", -1.0, r"0\.01 to 1e\+06 s"),
        ("prediction_horizon", 11.0, "0 to 10 s"),
    ],
)
def test_a_bad_setting_is_refused_in_one_line(field, value, expected):
    with pytest.raises(
        ValueError, match=rf"^map\.dynamic\.{field}: got {value:g}, expected {expected}$"
    ):
        DynamicConfig(**{field: value})


def test_a_rolling_sweep_is_met_where_its_moments_were():
    voxel_map, k = confident()
    origins = np.array([[0.05, 0.55, 0.55], [0.25, 0.35, 0.55]])
    moments = np.array([1, 0, 0], np.int32)
    ranges_mm = np.array([1000, 500, NOTHING], np.uint16)
    voxel_map.integrate(origins, np.repeat(ALONG_X, 3, axis=0), ranges_mm, 2.5, k * TENTH, moments)
    expected = [[0.55, 0.55, 0.575], [1.25, 0.35, 0.575]]
    np.testing.assert_allclose(voxel_map.dynamic_centres(), expected)


def test_the_version_binds_what_is_followed():
    voxel_map, k = confident()
    beam(voxel_map, 1000, k)
    before = voxel_map.version()
    assert voxel_map.version() == before
    voxel_map._traffic.tracks = ()
    assert voxel_map.version() != before
