import math

import numpy as np
import pytest

from maps import FREE, OCCUPIED, UNKNOWN, Costmap, MapConfig, VoxelMap

LOW, HIGH = (0.0, 0.0, -0.375), (3.0, 2.0, 1.125)  # layers of 0.1 m; the floor's is layer 3
FLOOR, BODY = 3, slice(5, 8)  # band of a body between 0.15 and 0.4 m: 0.125 to 0.425 m


@pytest.fixture
def voxel_map():
    """Known throughout: a floor with free space above and nothing known below."""
    voxel_map = VoxelMap(MapConfig(), LOW, HIGH)
    voxel_map.log_odds[:, :, FLOOR] = 900
    voxel_map.log_odds[:, :, FLOOR + 1 :] = -400
    return voxel_map


def ground(voxel_map, **config):
    return Costmap(MapConfig(**config), voxel_map, "ground", 0.2, height=0.4, step_height=0.15)


def air(voxel_map, floor=-math.inf, ceiling=math.inf, **config):
    config = MapConfig(inflation_margin=0.0, **config)
    return Costmap(config, voxel_map, "air", 0.2, 0.2, 0.0, floor=floor, ceiling=ceiling)


def brute_force(blocked, reach):
    """Squared distances to blocked cells or to the frame of cells around the array, one by one."""
    flat = blocked.shape[2] == 1
    framed = np.pad(blocked, [(1, 1), (1, 1), (0, 0) if flat else (1, 1)], constant_values=True)
    inner = np.argwhere(np.ones_like(blocked)) + ([1, 1, 0] if flat else [1, 1, 1])
    nearest = [((np.argwhere(framed) - cell) ** 2).sum(axis=1).min() for cell in inner]
    return np.minimum(np.reshape(nearest, blocked.shape), reach * reach)


@pytest.mark.parametrize(
    ("change", "state"),
    [
        ({}, FREE),
        ({BODY.start: 900}, OCCUPIED),  # an obstacle just above the step height
        ({BODY.stop - 1: 900}, OCCUPIED),  # at the height of the back
        ({BODY.stop: 900}, FREE),  # an overhang
        ({FLOOR + 1: 900}, FREE),  # a step
        ({FLOOR: 0, FLOOR + 1: 900}, FREE),  # standing on the step alone
        ({FLOOR: 0}, UNKNOWN),  # no floor was seen
        ({FLOOR: -400}, UNKNOWN),
        ({FLOOR: 0, 0: -400}, OCCUPIED),  # a beam went through where the floor should be
        ({FLOOR - 1: -400}, OCCUPIED),
        ({BODY.start: 0}, UNKNOWN),  # never seen in the band
        ({BODY.start: 0, BODY.stop - 1: 900}, OCCUPIED),
    ],
)
def test_the_state_of_a_column(voxel_map, change, state):
    for layer, value in change.items():
        voxel_map.log_odds[20, 10, layer] = value
    costmap = ground(voxel_map)
    assert costmap.shape == (30, 20, 1)
    assert costmap.state[20, 10, 0] == state
    assert np.count_nonzero(costmap.state != FREE) == (state != FREE)


def test_the_body_is_forbidden_near_what_the_policy_fears(voxel_map):
    voxel_map.log_odds[10, 10, BODY] = 900
    voxel_map.log_odds[20, 10, BODY] = 0
    forbid, allow = ground(voxel_map), ground(voxel_map, unknown_policy="allow")
    # (0.2 + 0.1) m is 3 cells, and half a diagonal 0.707: 3.707^2 = 13.7.
    assert forbid.blocked_at_or_below == allow.blocked_at_or_below == 13
    assert forbid.admissible()[[10, 10, 20, 20], [13, 14, 13, 14], 0].tolist() == [False, True] * 2
    assert allow.admissible()[[10, 20, 20], [13, 10, 13], 0].tolist() == [False, True, True]
    # The border is 3 cells from index 2, which is too near, and 4 from index 3.
    assert forbid.admissible()[2:4, 10, 0].tolist() == [False, True]
    assert forbid.field() is forbid.clearance
    assert ground(voxel_map, unknown_policy="penalize").field().max() > 13


@pytest.mark.parametrize("unknown", [0.0, 0.1])
def test_fields_equal_distances_counted_one_by_one(voxel_map, unknown):
    rng = np.random.default_rng(2)
    draw = rng.random(voxel_map.shape)
    voxel_map.log_odds[draw < unknown + 0.005] = 0
    voxel_map.log_odds[draw < 0.005] = 900
    for costmap in (ground(voxel_map), air(voxel_map)):
        reach = math.isqrt(costmap.truncation)
        np.testing.assert_array_equal(costmap.clearance, brute_force(costmap.state != FREE, reach))
        np.testing.assert_array_equal(
            costmap.obstacle_clearance, brute_force(costmap.state == OCCUPIED, reach)
        )


def test_the_air_has_the_states_of_the_voxels_within_the_window(voxel_map):
    costmap = air(voxel_map, floor=0.2, ceiling=0.9)
    # Whole layers only: 0.225 to 0.825 m.
    assert costmap.shape == (30, 20, 6)
    assert costmap.origin[2] == pytest.approx(0.225)
    assert np.all(costmap.state == FREE)
    assert costmap.clearance[15, 10].ravel().tolist() == [1, 4, 9, 9, 4, 1]
    np.testing.assert_array_equal(costmap.clearance, costmap.obstacle_clearance)
    np.testing.assert_array_equal(air(voxel_map).state, voxel_map.states())


def test_the_ball_keeps_half_a_space_diagonal(voxel_map):
    # 0.2 m is 2 cells, and half a diagonal 0.866: 2.866^2 = 8.2.
    assert air(voxel_map).blocked_at_or_below == 8


def test_the_cost_falls_by_navs_law(voxel_map):
    costmap = ground(voxel_map, cost_scaling_factor=3.0)
    table, edge = costmap.cost_table, 3.0 + math.sqrt(0.5)
    assert table.shape == (costmap.truncation + 1,)
    assert costmap.truncation == math.ceil(edge + 6.0) ** 2
    assert np.all(np.isinf(table[: 13 + 1]))
    assert table[16] == pytest.approx(252.0 * math.exp(-3.0 * 0.1 * (4.0 - edge)))
    assert table[81] == pytest.approx(252.0 * math.exp(-3.0 * 0.1 * (9.0 - edge)))
    assert np.all(np.diff(table[14:]) < 0.0)
    assert table[-1] == 0.0


def test_the_margin_widens_what_is_forbidden(voxel_map):
    voxel_map.log_odds[15, 10, BODY] = 900
    costmap = ground(voxel_map)
    before = costmap.admissible().sum()
    costmap.update(0.3)
    assert costmap.blocked_at_or_below == 32  # (5 + 0.707)^2 = 32.6
    assert costmap.margin == 0.3
    assert costmap.admissible().sum() < before
    costmap.update(0.1)
    assert costmap.admissible().sum() == before


def test_an_update_follows_the_map(voxel_map):
    costmap = ground(voxel_map)
    voxel_map.log_odds[15, 10, BODY] = 900
    assert costmap.state[15, 10, 0] == FREE
    costmap.update(0.1)
    assert costmap.state[15, 10, 0] == OCCUPIED
    assert costmap.clearance[15, 10, 0] == 0


def test_one_cell_of_unknown_blocks_like_an_obstacle_under_forbid():
    voxel_map = VoxelMap(MapConfig(), LOW, HIGH)
    assert not ground(voxel_map).admissible().any()
    assert ground(voxel_map, unknown_policy="allow").admissible().any()


@pytest.mark.parametrize(
    ("motion", "body", "message"),
    [
        ("water", {}, "motion: got 'water', expected one of ground, air"),
        ("ground", {"radius": 0.0}, "radius: got 0"),
        ("ground", {"radius": math.nan}, "radius: got nan"),
        ("ground", {"height": 1.5}, "height: got 1.5, expected up to the map's top, 1.125 m"),
        ("ground", {"step_height": 0.5}, "step_height: got 0.5, expected 0 to below the height"),
        ("ground", {"step_height": 0.01}, "step_height: got 0.01 m, in layer 3"),
        ("ground", {"radius": 20.0}, "expected at most 181"),
        ("air", {"floor": 2.0}, "floor, ceiling: got 2 to inf"),
        ("air", {"floor": 0.3, "ceiling": 0.35}, "floor, ceiling: got 0.3 to 0.35"),
    ],
)
def test_a_body_that_does_not_fit_is_refused(voxel_map, motion, body, message):
    body = {"radius": 0.2, "height": 0.4, "step_height": 0.15} | body
    with pytest.raises(ValueError, match=message):
        Costmap(MapConfig(), voxel_map, motion, **body)


@pytest.mark.parametrize("margin", [-0.1, math.nan, math.inf])
def test_a_bad_margin_is_refused(voxel_map, margin):
    with pytest.raises(ValueError, match="margin: got"):
        ground(voxel_map).update(margin)
