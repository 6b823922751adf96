import math

import numpy as np
import pytest

from tests.maps.sweeps import floor_scan, scattered
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, MapConfig, SweepStatistics, VoxelMap, states_in

FORWARD = np.array([[1.0, 0.0, 0.0]])
EYE = (0.55, 1.05, 0.475)  # the middle of a cell
CELL = [[2.55, 1.05, 0.475]]  # what a beam of 2 m forward meets
BEFORE = [[2.45, 1.05, 0.475]]
BEYOND = [[2.65, 1.05, 0.475]]


@pytest.fixture
def voxel_map():
    return VoxelMap(MapConfig(half_life=0.0))


def look(voxel_map, *ranges_mm, directions=None, origin=EYE, time_ns=0):
    directions = np.repeat(FORWARD, len(ranges_mm), 0) if directions is None else directions
    ranges_mm = np.array(ranges_mm, np.uint16)
    return voxel_map.integrate(origin, np.array(directions, float), ranges_mm, 3.0, time_ns)


def log_odds(voxel_map, points):
    """In units of 1/30, by way of the probabilities."""
    odds = voxel_map.probability_at(points)
    return np.rint(30.0 * np.log(odds / (1.0 - odds))).astype(int).tolist()


def along_x(count):
    """Centres of the cells ahead of the eye, from its own on."""
    return np.array(EYE) + np.arange(count)[:, None] * [0.1, 0.0, 0.0]


def probability(voxel_map, point):
    return round(float(voxel_map.probability_at(point)[0]), 2)


def test_three_hits_and_two_misses_give_the_probabilities_of_the_log_odds(voxel_map):
    seen = []
    for millimetres in (2000, 2000, 2000, 2500, 2500):
        look(voxel_map, millimetres)
        seen.append(probability(voxel_map, CELL))
    assert seen == [0.71, 0.86, 0.94, 0.91, 0.87]


@pytest.mark.parametrize(("prob_min", "returns"), [(0.12, 3), (0.2, 2), (0.3, 1)])
def test_returns_that_make_a_free_cell_occupied_by_the_lower_clamp(prob_min, returns):
    voxel_map = VoxelMap(MapConfig(half_life=0.0, prob_min=prob_min))
    for _ in range(20):
        look(voxel_map, 2500)
    states = []
    for _ in range(returns):
        look(voxel_map, 2000)
        states.append(int(voxel_map.state_at(CELL)[0]))
    assert states == [FREE] * (returns - 1) + [OCCUPIED]


def test_evidence_is_clamped_on_both_sides(voxel_map):
    for _ in range(20):
        look(voxel_map, 2000)
    assert probability(voxel_map, CELL) == 0.97
    assert probability(voxel_map, BEFORE) == 0.12
    assert log_odds(voxel_map, [*CELL, *BEFORE]) == [
        round(30 * math.log(0.97 / 0.03)),
        round(30 * math.log(0.12 / 0.88)),
    ]


def test_a_cell_is_updated_once_in_a_sweep(voxel_map):
    statistics = look(voxel_map, 2000, 2001, 2002)
    assert statistics == SweepStatistics(3, 0, 0, 0, cells_updated=21)
    assert log_odds(voxel_map, along_x(22)) == [-12] * 20 + [27, 0]


def test_occupied_wins_over_free_whatever_the_order(voxel_map):
    look(voxel_map, 2000, 2500)
    look(voxel_map, 2500, 2000)
    assert voxel_map.state_at([*CELL, *BEFORE, *BEYOND]).tolist() == [OCCUPIED, FREE, FREE]
    assert log_odds(voxel_map, [*CELL, *BEFORE, *BEYOND]) == [54, -24, -24]


def test_what_was_never_seen_is_unknown(voxel_map):
    look(voxel_map, 65535)
    elsewhere = [[-0.1, 1.0, 0.5], [5.0, 1.0, 0.5], [-9e5, 9e5, 1e5], [np.nan, 0.0, 0.0]]
    assert voxel_map.state_at(elsewhere).tolist() == [UNKNOWN] * 4
    assert voxel_map.probability_at(elsewhere).tolist() == [0.5] * 4
    assert voxel_map.observed_ns_at([*elsewhere[1:]]).tolist() == [-1] * 3


def test_a_brick_knows_when_it_was_last_observed(voxel_map):
    look(voxel_map, 1000, time_ns=5)
    look(voxel_map, 1000, time_ns=9)
    look(voxel_map, 1000, time_ns=7)  # a late sweep does not make it older
    at = [[1.55, 1.05, 0.4], [1.65, 1.05, 0.4]]  # bricks 0 and 1 along x
    assert voxel_map.observed_ns_at(at).tolist() == [9, -1]


@pytest.mark.parametrize("slope", [0.1, 0.2, 0.5])
def test_a_beam_onto_the_floor_spares_the_floor_before_its_end(voxel_map, slope):
    direction = np.array([[1.0, 0.0, -slope]]) / math.hypot(1.0, slope)
    origin = (0.55, 1.05, slope * 2.0)
    look(voxel_map, round(2000 * math.hypot(1.0, slope)), directions=direction, origin=origin)
    floor = states_in(voxel_map, (0.0, 1.0, -0.07), (4.0, 1.1, 0.02))[:, 0, 0]
    assert np.flatnonzero(floor == OCCUPIED).tolist() == [25]
    assert np.count_nonzero(floor == FREE) == 0
    assert voxel_map.counts()["free"] > 15


@pytest.mark.parametrize("height", [0.42, 0.6])
def test_a_flat_floor_seen_while_walking_stays_whole(height):
    """1 m at 1 m/s, 10 sweeps a second."""
    directions, ranges_mm = floor_scan(height)
    voxel_map = VoxelMap(MapConfig())
    floor_box = ((-9.0, -9.0, -0.07), (9.0, 9.0, 0.02))
    ever_hit = np.zeros((180, 180), bool)
    for k in range(11):
        voxel_map.integrate((0.1 * k, 0.0, height), directions, ranges_mm, 8.0, k * 10**8)
        ever_hit |= states_in(voxel_map, *floor_box)[:, :, 0] == OCCUPIED
    floor = states_in(voxel_map, *floor_box)[:, :, 0]
    assert ever_hit.sum() > 2000
    assert np.all(floor[ever_hit] == OCCUPIED)


def test_presence_frees_unknown_space_but_no_obstacle(voxel_map):
    look(voxel_map, 2000)
    voxel_map.mark_free((2.4, 0.9, 0.4), (2.8, 1.2, 0.6), 3)
    assert voxel_map.state_at([*CELL, *BEYOND]).tolist() == [OCCUPIED, FREE]
    inside, beside = [2.75, 1.05, 0.475], [2.85, 1.05, 0.475]
    assert log_odds(voxel_map, [inside, beside]) == [-12, 0]  # its centre is outside the box
    assert voxel_map.observed_ns_at(CELL).tolist() == [3]


def test_a_standing_body_marks_the_floor_unless_a_beam_went_through(voxel_map):
    voxel_map.mark_free((1.0, 1.0, -0.1), (1.1, 1.1, 0.0), 0)
    voxel_map.mark_floor((1.0, 1.0), (1.2, 1.2), 0)
    assert states_in(voxel_map, (1.0, 1.0, -0.07), (1.2, 1.2, 0.02))[:, :, 0].tolist() == [
        [1, 2],
        [2, 2],
    ]
    assert voxel_map.counts()["occupied"] == 3


def test_ranges_must_be_16_bit_millimetres(voxel_map):
    with pytest.raises(ValueError, match="uint16"):
        voxel_map.integrate(EYE, FORWARD, np.array([1.0]), 3.0, 0)


def test_a_read_only_sweep_as_a_log_yields_it(voxel_map):
    directions, ranges_mm = FORWARD.copy(), np.array([2000], np.uint16)
    directions.flags.writeable = ranges_mm.flags.writeable = False
    assert voxel_map.integrate(EYE, directions, ranges_mm, 3.0, 0).cells_updated == 21


@pytest.mark.parametrize(
    "settings", [{}, {"prob_min": 0.001, "prob_max": 0.999, "log_odds_hit": 0.85}]
)
def test_steps_and_clamps_are_the_configured_ones_in_whole_units(settings):
    config = MapConfig(half_life=0.0, **settings)
    voxel_map = VoxelMap(config)
    model = voxel_map.evidence
    look(voxel_map, 2000)
    seen = voxel_map.probability_at([*CELL, *BEFORE])
    steps = [model.hit / model.units, -model.miss / model.units]
    configured = [config.log_odds_hit, -config.log_odds_miss]
    np.testing.assert_allclose(np.log(seen / (1 - seen)), steps)
    np.testing.assert_allclose(steps, configured, atol=0.5 / model.units)
    for _ in range(60):
        look(voxel_map, 2000)
    clamps = [float(model.probability(units)) for units in (model.high, model.low)]
    np.testing.assert_allclose(voxel_map.probability_at([*CELL, *BEFORE]), clamps)
    np.testing.assert_allclose(clamps, [config.prob_max, config.prob_min], atol=0.004)


def test_a_bounded_map_is_the_unbounded_one_in_its_region():
    for seed in range(4):
        rng = np.random.default_rng(seed)
        config = MapConfig(resolution=0.1, memory_mib=8, half_life=2.0)
        low = rng.uniform(-2.5, -0.1, 3)
        high = low + rng.uniform(0.15, 3.5, 3)
        bounded, whole = VoxelMap(config, low, high), VoxelMap(config)
        for voxel_map in (bounded, whole):
            draw = np.random.default_rng(seed)
            for k in range(6):
                directions, ranges_mm = scattered(draw, 300, 200, 5000)
                ranges_mm[::4] = 65535
                origin, time_ns = draw.uniform(-2.0, 2.0, 3), k * 700_000_000
                voxel_map.integrate(origin, directions, ranges_mm, 4.0, time_ns)
                voxel_map.mark_free(origin - 0.3, origin + 0.2, time_ns)
                voxel_map.mark_free_sphere(draw.uniform(-3.0, 3.0, 3), 0.7, time_ns)
                voxel_map.mark_floor([-3.0, -3.0], [0.5, 0.5], time_ns)
                voxel_map.exempt_from_decay(origin, origin + 1.0, time_ns)
        first, end = (np.floor(corner / 0.1 + [0, 0, 0.75]).astype(int) for corner in (low, high))
        cells = np.moveaxis(np.indices((60, 60, 60)), 0, -1).reshape(-1, 3) - 30
        inside = np.all((first <= cells) & (cells <= end), axis=1)
        middles = (cells + np.array([0.5, 0.5, -0.25])) * 0.1
        expected = np.where(inside, whole.probability_at(middles), 0.5)
        np.testing.assert_array_equal(bounded.probability_at(middles), expected)
        assert np.count_nonzero(expected < 0.5) > 50
        beyond = np.array([[50.0, 0.0, 0.0]])
        assert bounded.state_at(beyond)[0] == UNKNOWN
