"""The contract of every representation."""

import numpy as np
import pytest

from tests.maps.counting_map import CountingMap, HalvingMap
from tests.maps.sweeps import scattered
from wayproof.maps import (
    FREE,
    MAPS,
    OCCUPIED,
    UNKNOWN,
    Costmap,
    CostmapConfig,
    MapConfig,
    SweepStatistics,
)
from wayproof.maps.grid import centres

SECOND = 10**9
EYE = np.array([0.55, 1.05, 0.475])  # the middle of a cell
FORWARD = np.array([[1.0, 0.0, 0.0]])
LOW, SHAPE = (-34, -34, -34), (78, 78, 78)  # cells around the eye, within the reach of its beams

KINDS = {**MAPS, "counting": CountingMap, "halving": HalvingMap}
FADING = sorted(kind for kind in KINDS if KINDS[kind].decays)
# OctoMap takes no bound on its memory and no region of interest.
BOUNDED = sorted(set(KINDS) - {"octomap"})
HIGH = sorted(set(KINDS) - {"grid2d"})  # know heights

every_map = pytest.mark.parametrize("kind", sorted(KINDS))


def make(kind, low=None, high=None, **settings):
    config = MapConfig(**({"kind": kind, "half_life": 0.0, "memory_mib": 16} | settings))
    return KINDS[kind](config, low, high)


def look(a_map, *ranges_mm, directions=None, origin=EYE, time_ns=0, limit=3.0, moments=None):
    directions = np.repeat(FORWARD, len(ranges_mm), 0) if directions is None else directions
    ranges_mm = np.array(ranges_mm, np.uint16)
    arguments = np.array(directions, float).reshape(-1, 3), ranges_mm, limit, time_ns, moments
    return a_map.integrate(origin, *arguments)


def look_around(a_map, seed, **keywords):
    directions, ranges_mm = scattered(np.random.default_rng(seed), 300, 300, 2500)
    return look(a_map, *ranges_mm, directions=directions, **keywords)


def ahead(*metres):
    return EYE + np.array(metres)[:, None] * FORWARD


def states(a_map):
    """Of the cells around the eye, one by one."""
    cells = np.stack(np.indices(SHAPE), axis=-1).reshape(-1, 3) + LOW
    return a_map.state_at(centres(cells, a_map.resolution)).reshape(SHAPE)


def bits(a_map):
    """The same by columns."""
    columns = a_map.columns(LOW, (*SHAPE[:2], 2))
    occupied, free = (
        np.unpackbits(words.astype("<u8").view(np.uint8), axis=2, bitorder="little")
        for words in columns
    )
    return (occupied * OCCUPIED + free * FREE)[:, :, : SHAPE[2]]


def assert_obstacles(costmap, a_map):
    """They are the cells that the map says are occupied, one by one, and some are."""
    places = costmap.origin + (np.stack(np.indices(costmap.shape), axis=-1) + 0.5) * 0.1
    occupied = a_map.state_at(places.reshape(-1, 3)).reshape(costmap.shape) == OCCUPIED
    np.testing.assert_array_equal(costmap.obstacle_clearance == 0, occupied)


@every_map
@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"origin": (np.nan, 0, 0)}, "origins: got .*, expected finite coordinates within 1e6 m"),
        ({"origin": (0.0, 0.0)}, r"origins: got shape \(2,\), expected"),
        ({"directions": [[2.0, 0.0, 0.0]]}, "directions: got .*, expected unit length"),
        ({"directions": [[np.nan, 0.0, 0.0]]}, "directions: got .*, expected unit length"),
        ({"directions": [FORWARD] * 2}, r"beams: got directions \(2, 3\) and ranges uint16 \(1,\)"),
        ({"limit": 300.0}, "range_limit: got 300, expected up to 204.7 m"),
        ({"limit": 0.0}, "range_limit: got 0, expected up to 204.7 m"),
        ({"time_ns": -1}, "time_ns: got -1, expected 0 or more"),
        ({"origin": [EYE, EYE]}, "moments: got none for 2 origins"),
        ({"moments": np.array([1])}, "moments: got .*, expected whole numbers"),
    ],
)
def test_a_bad_sweep_is_refused_in_one_line_and_changes_nothing(kind, change, message):
    a_map = make(kind)
    look(a_map, 2000)
    before = a_map.version()
    with pytest.raises(ValueError, match=f"^{message}[^\n]*$"):
        look(a_map, 1000, **change)
    assert a_map.version() == before


@every_map
def test_bad_marks_and_times_are_refused(kind):
    a_map = make(kind)
    for refused in (
        lambda: a_map.mark_free((np.nan, 0.0, 0.0), (1.0, 1.0, 1.0), 0),
        lambda: a_map.mark_floor((0.0, 0.0), (np.inf, 1.0), 0),
        lambda: a_map.mark_free((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), -1),
        lambda: a_map.advance(-1),
    ):
        with pytest.raises(ValueError, match=r"^(low|high|time_ns): got [^\n]*$"):
            refused()
    assert a_map.version() == make(kind).version()


@pytest.mark.parametrize("kind", BOUNDED)
def test_one_corner_is_refused(kind):
    with pytest.raises(ValueError, match=r"^low, high: got .* expected both corners or neither$"):
        make(kind, low=(0.0, 0.0, 0.0))


@every_map
def test_beams_are_counted_by_their_fate(kind):
    a_map = make(kind)
    fates = look(a_map, 0, 299, 300, 3000, 3001, 65535)
    assert (fates.dropped, fates.too_near, fates.hits, fates.clears) == (
        1,
        1,
        2,
        2,
    )
    assert a_map.state_at(ahead(0.3, 3.0)).tolist() == [OCCUPIED] * 2  # occupied wins
    nothing = make(kind)
    fates = look(nothing, 0, 0, 299, 1)
    assert fates == SweepStatistics(0, 0, 2, 2, 0)
    assert look(nothing) == SweepStatistics(0, 0, 0, 0, 0)
    assert nothing.version() == make(kind).version()
    assert nothing.counts() == {"free": 0, "occupied": 0}


@every_map
def test_a_missing_return_is_none_however_far_a_sensor_sees(kind):
    a_map = make(kind)
    statistics = look(a_map, 65535, limit=70.0)
    assert (statistics.hits, statistics.clears) == (0, 1)
    assert a_map.counts()["occupied"] == 0
    assert a_map.state_at(ahead(65.5, 69.9)).tolist() == [FREE, FREE]


@every_map
@pytest.mark.parametrize("place", [(-777.65, 12.35), (1500.05, -1499.95)])
def test_a_robot_may_be_anywhere(kind, place):
    origin = np.array([*place, 0.475])
    a_map = make(kind)
    look(a_map, 2000, origin=origin)
    found = a_map.state_at(origin + np.array([[1.8, 0, 0], [2.0, 0, 0], [1.8, 0.3, 0]]))
    assert found.tolist() == [FREE, OCCUPIED, UNKNOWN]


@every_map
def test_a_rolling_sweep_starts_each_beam_where_the_sensor_was(kind):
    a_map = make(kind)
    moments = np.array([1, 0], np.int32)
    look(a_map, 2000, 1500, origin=[EYE, (0.55, 1.55, 0.475)], moments=moments)
    at = [[2.55, 1.55, 0.475], [2.05, 1.05, 0.475], [1.75, 1.05, 0.475], [2.75, 1.05, 0.475]]
    assert a_map.state_at(at).tolist() == [OCCUPIED, OCCUPIED, FREE, UNKNOWN]


@every_map
def test_marks_spare_what_contradicts_them_and_time_passes(kind):
    a_map = make(kind)
    look(a_map, 2000)
    a_map.mark_free((2.4, 1.0, 0.1), (2.8, 1.2, 0.6), 3)
    assert a_map.state_at([*ahead(2.0), [2.55, 1.15, 0.475]]).tolist() == [OCCUPIED, FREE]
    assert a_map.observed_ns_at([[2.55, 1.15, 0.475], (-9.0, 0.0, 0.0)]).tolist() == [3, -1]
    before = a_map.version()
    a_map.mark_free((1.0, 1.0, 1.0), (0.9, 1.0, 1.0), 5)  # empty
    a_map.mark_floor((1.0, 1.0), (0.0, 0.0), 5)
    assert a_map.version() == before


@pytest.mark.parametrize("kind", HIGH)
def test_a_body_marks_a_ball_and_the_floor(kind):
    a_map = make(kind)
    a_map.mark_free_sphere((2.05, 1.05, 0.975), 0.21, 0)
    assert a_map.counts() == {"free": 33, "occupied": 0}  # 1 + 6 + 12 + 8 + 6 within 2.1 cells
    a_map.mark_floor((1.0, 1.0), (1.2, 1.2), 7)
    a_map.mark_free((1.0, 1.0, -0.1), (1.4, 1.2, 0.0), 9)
    assert a_map.counts() == {"free": 37, "occupied": 4}
    with pytest.raises(ValueError, match="centre: got"):
        a_map.mark_free_sphere((np.inf, 0.0, 0.0), 0.2, 0)


@every_map
def test_all_queries_agree(kind):
    a_map = make(kind)
    for seed in range(3):
        look_around(a_map, seed, time_ns=seed)
    expected = states(a_map)
    assert (expected == OCCUPIED).sum() > 250
    np.testing.assert_array_equal(bits(a_map), expected)
    if kind != "grid2d":  # a cell of which stands for many
        chances = a_map.probability_at(centres(np.argwhere(expected) + LOW, 0.1))
        np.testing.assert_array_equal(chances > 0.5, expected[expected > 0] == OCCUPIED)
        assert a_map.counts()["occupied"] == (expected == OCCUPIED).sum()
        assert a_map.counts()["free"] == (expected == FREE).sum()
    assert a_map.state_at(np.empty((0, 3))).shape == (0,)
    assert a_map.memory_bytes() > 0


@every_map
@pytest.mark.parametrize("motion", ["ground", "air"])
def test_every_change_is_logged_and_a_costmap_follows(kind, motion):
    a_map = make(kind, half_life=2.0 if KINDS[kind].decays else 0.0)
    body = (-2.0, -2.0, -0.3), (2.0, 2.0, 1.5), motion, 0.15, 0.4, 0.1
    following, now, before = Costmap(CostmapConfig(), a_map, *body), 0, np.zeros(SHAPE, np.uint8)
    for k in range(8):
        if k < 4:
            look_around(a_map, k, time_ns=k * SECOND)
        a_map.advance(3 * k * SECOND)
        boxes, now = a_map.changed(now)
        now_bits = bits(a_map)
        cells = np.argwhere(now_bits != before) + LOW
        assert len(cells) > 100 or k >= 4
        inside = np.zeros(len(cells), bool)
        for box in boxes:
            inside |= np.all((cells >= box[:3]) & (cells < box[3:]), axis=1)
        assert inside.all()
        before = now_bits
        following.update(0.1)
        anew = Costmap(CostmapConfig(), a_map, *body)
        assert (following.clearance == anew.clearance).all()
        assert (following.obstacle_clearance == anew.obstacle_clearance).all()
        if motion == "air":
            assert_obstacles(following, a_map)
    assert len(a_map.changed(now)[0]) == 0


@pytest.mark.parametrize("kind", BOUNDED)
def test_the_order_of_beams_does_not_count(kind):
    alone, shuffled = make(kind), make(kind)
    for k in range(3):
        directions, ranges_mm = scattered(np.random.default_rng(k), 300, 300, 2500)
        order = np.random.default_rng(k).permutation(len(directions))
        statistics = [
            look(alone, *ranges_mm, directions=directions),
            look(shuffled, *ranges_mm[order], directions=directions[order]),
        ]
        assert statistics[0] == statistics[1]
        assert alone.version() == shuffled.version()
    assert alone.counts()["occupied"] > 100


@every_map
def test_versions_are_those_of_the_content(kind):
    there, back, empty = make(kind), make(kind), make(kind).version()
    places = [[x, 0.0, 0.4] for x in (-40.0, 0.0, 300.0)]
    for origin in places:
        look(there, 2000, origin=origin)
    seen = {empty}
    for origin in places[::-1]:
        look(back, 2000, origin=origin)
        assert len(back.version()) == 32
        assert back.version() not in seen
        seen.add(back.version())
    assert there.version() == back.version() == there.version()
    assert make(kind, resolution=0.2).version() != empty


@pytest.mark.parametrize("kind", FADING)
def test_unseen_cells_decay_by_ticks_until_they_are_unknown(kind):
    step_by_step, late = make(kind, half_life=1.0), make(kind, half_life=1.0)
    unknown = late.version()
    look(step_by_step, 2000, time_ns=100)
    look(late, 2000, time_ns=100)
    chances, versions = [], set()
    for k in range(1, 13):
        step_by_step.advance(k * SECOND)
        step_by_step.advance(0)  # the past does nothing
        chances += step_by_step.probability_at(ahead(2.0)).tolist()
        versions.add(step_by_step.version())
    assert chances[0] == late.probability_at(ahead(2.0))[0]  # seen within that tick
    assert chances == sorted(chances, reverse=True)
    assert chances[-1] == 0.5 < chances[3] < chances[1]
    assert len(versions) > 4
    late.advance(12 * SECOND)
    assert late.version() == step_by_step.version() == unknown
    assert late.observed_ns_at(ahead(2.0)).tolist() == [-1]
    assert late.counts() == {"free": 0, "occupied": 0}


@pytest.mark.parametrize("kind", sorted(set(KINDS) - set(FADING)))
def test_a_map_without_decay_refuses_a_half_life(kind):
    expected = f"^map.half_life: got 30, expected 0 with map.kind '{kind}', which has no decay$"
    with pytest.raises(ValueError, match=expected):
        make(kind, half_life=30.0)


@every_map
def test_an_exemption_from_decay_is_taken_or_refused(kind):
    settings = {"half_life": 1.0 if KINDS[kind].decays else 0.0, "no_decay_radius": 0.5}
    if not KINDS[kind].exempts:
        with pytest.raises(ValueError, match=r"^map\.no_decay_radius: got 0\.5, expected 0 with "):
            make(kind, **settings)
        return
    a_map = make(kind, **settings)
    look(a_map, 2000)
    for k in range(1, 40):
        a_map.exempt_from_decay((2.4, 0.9, 0.3), (2.7, 1.2, 0.6), k * SECOND - 1)
        a_map.advance(k * SECOND)
    assert a_map.state_at(ahead(1.5, 2.0)).tolist() == [UNKNOWN, OCCUPIED]


@pytest.mark.parametrize("kind", BOUNDED)
def test_memory_is_bounded_and_the_oldest_goes(kind):
    a_map, now, gone = make(kind, memory_mib=1), 1, set()
    for k in range(150):
        look(a_map, 2000, origin=(20.0 * k, 1.05, 0.475), time_ns=k)
        boxes, now = a_map.changed(now)
        gone.update(box[0] for box in boxes.tolist() if box[3] <= 200 * k)
    at = [[2.05, 1.05, 0.475], [2982.05, 1.05, 0.475]]
    assert a_map.state_at(at).tolist() == [UNKNOWN, OCCUPIED]
    assert 0 in gone


@pytest.mark.parametrize("kind", BOUNDED)
def test_a_region_of_interest_holds_what_a_map_without_bounds_does(kind):
    low, high = (0.0, 0.4, -0.3), (1.4, 1.9, 0.9)
    bounded, unbounded = make(kind, low=low, high=high), make(kind)
    for seed in range(3):
        look_around(bounded, seed)
        look_around(unbounded, seed)
    inside = np.s_[34:48, 38:53, 32:42]
    np.testing.assert_array_equal(states(bounded)[inside], states(unbounded)[inside])
    assert 0 < bounded.counts()["free"] < unbounded.counts()["free"]
    far_off = make(kind, low=(50.0, 50.0, -0.2), high=(51.0, 51.0, 1.0))
    assert look(far_off, 2000) == SweepStatistics(1, 0, 0, 0, 0)
    far_off.mark_free((0.0, 0.0, 0.1), (1.0, 1.0, 1.0), 0)
    assert far_off.counts() == {"free": 0, "occupied": 0}


@pytest.mark.parametrize("kind", sorted(kind for kind in MAPS if hasattr(MAPS[kind], "save")))
def test_a_file_holds_the_lasting_evidence(kind, tmp_path):
    a_map = make(kind)
    look_around(a_map, 1)
    a_map.save(tmp_path / "map")
    loaded = MAPS[kind].load(tmp_path / "map")
    assert loaded.config == a_map.config
    np.testing.assert_array_equal(states(loaded), states(a_map))
