import math

import numpy as np
import pytest

from maps import FREE, OCCUPIED, UNKNOWN, MapConfig, SweepStatistics, VoxelMap

LOW, HIGH = (0.0, 0.0, -0.075), (4.0, 2.0, 1.925)
FORWARD = np.array([[1.0, 0.0, 0.0]])
EYE = (0.55, 1.05, 0.475)  # the middle of a cell
CELL = [[2.55, 1.05, 0.475]]  # what a beam of 2 m forward meets
BEFORE = [[2.45, 1.05, 0.475]]
BEYOND = [[2.65, 1.05, 0.475]]


@pytest.fixture
def voxel_map():
    return VoxelMap(MapConfig(half_life=0.0), LOW, HIGH)


def look(voxel_map, *ranges_mm, directions=None, origin=EYE, time_ns=0):
    directions = np.repeat(FORWARD, len(ranges_mm), 0) if directions is None else directions
    ranges_mm = np.array(ranges_mm, np.uint16)
    return voxel_map.integrate(origin, np.array(directions, float), ranges_mm, 3.0, time_ns)


def probability(voxel_map, point):
    return round(float(voxel_map.probability_at(point)[0]), 2)


def test_three_hits_and_two_misses_give_the_probabilities_of_the_log_odds(voxel_map):
    seen = []
    for millimetres in (2000, 2000, 2000, 2500, 2500):
        look(voxel_map, millimetres)
        seen.append(probability(voxel_map, CELL))
    assert seen == [0.71, 0.86, 0.94, 0.91, 0.87]


def test_seven_misses_take_three_hits_below_zero(voxel_map):
    for _ in range(3):
        look(voxel_map, 2000)
    states = []
    for _ in range(7):
        look(voxel_map, 2500)
        states.append(int(voxel_map.state_at(CELL)[0]))
    assert states == [OCCUPIED] * 6 + [FREE]


def test_evidence_is_clamped_on_both_sides(voxel_map):
    for _ in range(20):
        look(voxel_map, 2000)
    assert probability(voxel_map, CELL) == 0.97
    assert probability(voxel_map, BEFORE) == 0.12
    assert voxel_map.log_odds.max() == round(1000 * math.log(0.97 / 0.03))
    assert voxel_map.log_odds.min() == round(1000 * math.log(0.12 / 0.88))


def test_a_cell_is_updated_once_in_a_sweep(voxel_map):
    statistics = look(voxel_map, 2000, 2001, 2002)
    assert statistics == SweepStatistics(3, 0, 0, 0, cells_updated=21)
    assert sorted(np.unique(voxel_map.log_odds)) == [-400, 0, 900]


def test_occupied_wins_over_free_whatever_the_order(voxel_map):
    look(voxel_map, 2000, 2500)
    look(voxel_map, 2500, 2000)
    assert voxel_map.state_at([*CELL, *BEFORE, *BEYOND]).tolist() == [OCCUPIED, FREE, FREE]
    assert voxel_map.log_odds.max() == 1800


def test_a_beam_without_return_clears_up_to_the_limit(voxel_map):
    statistics = look(voxel_map, 65535)
    assert statistics == SweepStatistics(0, 1, 0, 0, cells_updated=31)
    at = [[3.55, 1.05, 0.475], [3.65, 1.05, 0.475]]
    assert voxel_map.state_at(at).tolist() == [FREE, UNKNOWN]


def test_a_return_beyond_the_limit_is_no_evidence_of_an_obstacle(voxel_map):
    assert look(voxel_map, 3200).clears == 1
    assert voxel_map.counts() == {"unknown": 4 * 2 * 2 * 1000 - 31, "free": 31, "occupied": 0}


def test_dropped_and_near_beams_tell_nothing(voxel_map):
    assert look(voxel_map, 0, 299) == SweepStatistics(0, 0, 1, 1, cells_updated=0)
    assert not voxel_map.log_odds.any()
    assert voxel_map.observed_ns_at(CELL).tolist() == [-1]


def test_no_beams_at_all(voxel_map):
    empty = voxel_map.integrate(EYE, np.empty((0, 3)), np.empty(0, np.uint16), 3.0, 0)
    assert empty == SweepStatistics(0, 0, 0, 0, 0)


def test_a_beam_enters_from_outside_and_leaves_again(voxel_map):
    look(voxel_map, 65535, origin=(-0.95, 1.05, 0.475))
    assert voxel_map.state_at([[0.05, 1.05, 0.475], [1.95, 1.05, 0.475]]).tolist() == [FREE, FREE]
    look(voxel_map, 65535, origin=(3.05, 1.05, 0.475))
    assert voxel_map.counts()["free"] == 31  # 21 from the left, 10 to the right border


def test_outside_is_unknown(voxel_map):
    look(voxel_map, 65535)
    outside = [[-0.1, 1.0, 0.5], [5.0, 1.0, 0.5], [np.nan, 0.0, 0.0]]
    assert voxel_map.state_at(outside).tolist() == [UNKNOWN] * 3
    assert voxel_map.probability_at(outside).tolist() == [0.5] * 3
    assert voxel_map.observed_ns_at(outside).tolist() == [-1] * 3


def test_a_block_knows_when_it_was_last_observed(voxel_map):
    look(voxel_map, 1000, time_ns=5)
    look(voxel_map, 1000, time_ns=9)
    look(voxel_map, 1000, time_ns=7)  # a late sweep does not make it older
    at = [[1.55, 1.05, 0.4], [1.65, 1.05, 0.4]]  # blocks 0 and 1 along x
    assert voxel_map.observed_ns_at(at).tolist() == [9, -1]


@pytest.mark.parametrize("slope", [0.1, 0.2, 0.5])
def test_a_beam_onto_the_floor_spares_the_floor_before_its_end(voxel_map, slope):
    direction = np.array([[1.0, 0.0, -slope]]) / math.hypot(1.0, slope)
    origin = (0.55, 1.05, slope * 2.0)
    look(voxel_map, round(2000 * math.hypot(1.0, slope)), directions=direction, origin=origin)
    floor = voxel_map.states()[:, 10, 0]
    assert np.flatnonzero(floor == OCCUPIED).tolist() == [25]
    assert np.count_nonzero(floor == FREE) == 0
    assert voxel_map.counts()["free"] > 15


@pytest.mark.parametrize("height", [0.42, 0.6])
def test_a_flat_floor_seen_while_walking_stays_whole(height):
    """32 rings from -45 to +15 degrees, 1 m at 1 m/s, 10 sweeps a second."""
    elevation = np.deg2rad(np.linspace(-45.0, 15.0, 32))[:, None]
    azimuth = np.arange(250) * (2.0 * np.pi / 250)
    directions = np.stack(
        [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation) + 0.0 * azimuth,
        ],
        axis=-1,
    ).reshape(-1, 3)
    with np.errstate(divide="ignore"):
        ranges = np.where(directions[:, 2] < 0.0, -height / directions[:, 2], np.inf)
    ranges_mm = np.where(ranges > 8.0, 65535, np.round(1000.0 * ranges)).astype(np.uint16)
    voxel_map = VoxelMap(MapConfig(), (-9.0, -9.0, -0.2), (9.0, 9.0, 1.0))
    ever_hit = np.zeros(voxel_map.shape[:2], bool)
    for k in range(11):
        voxel_map.integrate((0.1 * k, 0.0, height), directions, ranges_mm, 8.0, k * 10**8)
        ever_hit |= voxel_map.states()[:, :, voxel_map.grid.floor_layer] == OCCUPIED
    floor = voxel_map.states()[:, :, voxel_map.grid.floor_layer]
    assert ever_hit.sum() > 2000
    assert np.all(floor[ever_hit] == OCCUPIED)


def test_presence_frees_unknown_space_but_no_obstacle(voxel_map):
    look(voxel_map, 2000)
    voxel_map.mark_free((2.4, 0.9, 0.4), (2.8, 1.2, 0.6), 3)
    assert voxel_map.state_at([*CELL, *BEYOND]).tolist() == [OCCUPIED, FREE]
    assert voxel_map.log_odds[27, 10, 5] == -400
    assert voxel_map.log_odds[28, 10, 5] == 0  # its centre is outside the box
    assert voxel_map.observed_ns_at(CELL).tolist() == [3]


def test_a_free_sphere_holds_the_centres_within_its_radius(voxel_map):
    voxel_map.mark_free_sphere((2.05, 1.05, 0.975), 0.21, 0)
    # Centres at offsets of whole cells with i^2 + j^2 + k^2 <= 4: 33 of them.
    assert voxel_map.counts()["free"] == 33
    voxel_map.mark_free_sphere((9.0, 9.0, 9.0), 0.2, 0)
    assert voxel_map.counts()["free"] == 33


def test_a_standing_body_tells_of_the_floor_unless_a_beam_went_through(voxel_map):
    voxel_map.mark_free((1.0, 1.0, -0.1), (1.1, 1.1, 0.0), 0)
    voxel_map.mark_floor((1.0, 1.0), (1.2, 1.2), 0)
    assert voxel_map.states()[10:12, 10:12, 0].tolist() == [[1, 2], [2, 2]]
    assert voxel_map.counts()["occupied"] == 3


@pytest.mark.parametrize(
    ("origin", "directions", "ranges_mm", "limit", "message"),
    [
        ((np.nan, 0, 0), FORWARD, [1], 3.0, "origin: got"),
        ((np.inf, 0, 0), FORWARD, [1], 3.0, "origin: got"),
        (EYE, [[np.nan, 0.0, 0.0]], [1], 3.0, "unit length"),
        (EYE, [[2.0, 0.0, 0.0]], [1], 3.0, "unit length"),
        (EYE, FORWARD, [1, 2], 3.0, "beams: got"),
        (EYE, FORWARD, [1], 0.0, "range_limit: got 0, expected up to 204.7 m"),
        (EYE, FORWARD, [1], np.nan, "range_limit"),
        (EYE, FORWARD, [1], 300.0, "range_limit"),
    ],
)
def test_bad_sweeps_are_refused_and_change_nothing(
    voxel_map, origin, directions, ranges_mm, limit, message
):
    before = voxel_map.version()
    with pytest.raises(ValueError, match=message):
        voxel_map.integrate(
            origin, np.array(directions, float), np.array(ranges_mm, np.uint16), limit, 0
        )
    assert voxel_map.version() == before


def test_ranges_must_be_16_bit_millimetres(voxel_map):
    with pytest.raises(ValueError, match="uint16"):
        voxel_map.integrate(EYE, FORWARD, np.array([1.0]), 3.0, 0)


def test_memory_is_three_bytes_a_cell_and_little_more(voxel_map):
    cells = voxel_map.log_odds.size
    assert 3 * cells < voxel_map.memory_bytes() < 3.1 * cells
