"""Ramps, steps, holes and overhangs: by hand, against a slow truth, and through a map's sweeps."""

import math

import numpy as np
import pytest

from tests.maps.costmap.test_costmap import StateArray
from tests.maps.sweeps import scan
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, Costmap, CostmapConfig, MapConfig, VoxelMap
from wayproof.maps.costmap.terrain import BASELINE, rises

FLOOR, LAYERS, SIZE = 4, 40, (40, 24)
LOW, HIGH = (0.0, 0.0, -0.475), (4.0, 2.4, 3.525)  # cells of 0.1 m, the floor's is layer 4
ACROSS = np.arange(SIZE[0])[:, None] + 0.0 * np.arange(SIZE[1])  # 0.1 m


def world(height):
    """Known cells over a surface of some height (nx, ny), m; NaN: a hole."""
    layers = np.floor(np.nan_to_num(height, nan=-9.0) / 0.1 + 0.75).astype(int) + FLOOR
    z = np.arange(LAYERS)
    states = np.where(z > layers[:, :, None], FREE, UNKNOWN).astype(np.uint8)
    states[z == layers[:, :, None]] = OCCUPIED
    return StateArray(states, (0, 0, -FLOOR))


def projected(cells, step_height=0.03, max_slope=0.3, height=0.45):
    config = CostmapConfig(max_slope=max_slope)
    return Costmap(config, cells, LOW, HIGH, "ground", 0.2, height, step_height).state[:, :, 0]


def ramp(angle, start=10.0, top=1.0):
    return np.clip(0.1 * (ACROSS - start) * math.tan(angle), 0.0, top)


@pytest.mark.parametrize("angle", [0.1, 0.3])
def test_a_ramp_up_to_the_slope_is_walked_over(angle):
    for start in np.arange(10.0, 11.0, 0.1):
        assert (projected(world(ramp(angle, start))) == FREE).all()
    assert (projected(world(-0.5 * ramp(angle)), max_slope=0.15) == FREE).all()  # and down
    assert (projected(world(ramp(angle, top=0.5))) == FREE).all()  # and onto a platform
    assert (projected(world(ramp(angle)), max_slope=0.0) != FREE).any()


def test_a_ramp_may_lie_oblique_and_be_seen_here_and_there():
    rng = np.random.default_rng(1)
    for turn in np.linspace(0.0, 2.0 * np.pi, 16):
        at = (
            np.indices(SIZE) + rng.uniform(0.0, 1.0, (2, *SIZE)) - np.array([20, 12])[:, None, None]
        )
        along = at[0] * np.cos(turn) + at[1] * np.sin(turn)
        height = 0.1 * np.clip(along, -14.0, 14.0) * math.tan(0.3)
        assert (projected(world(height - height.min())) == FREE)[:, :].all()


@pytest.mark.parametrize("angle", [0.5, 1.2])
def test_a_steeper_one_is_an_obstacle(angle):
    state = projected(world(ramp(angle, top=1.5)))
    assert (state[:10] == FREE).all()
    assert (state[10:] == OCCUPIED).all(axis=1).any()  # no way up


@pytest.mark.parametrize(
    ("step", "walked"), [(0.02, True), (0.2, False), (0.3, False), (2.0, False)]
)
def test_a_step_is_an_edge_to_both_sides(step, walked):
    up = np.where(ACROSS < 20, 0.0, step)
    for height in (up, up - step):
        state = projected(world(height))
        assert (state == FREE).all() == walked
        if not walked:
            assert (state[19:21] != FREE).all(axis=1).any()


def test_stairs_within_the_step_height_are_walked_over():
    stairs = np.floor(np.clip(ACROSS - 5, 0, 30) / 6) * 0.1  # 0.1 m high, 0.6 m deep
    assert (projected(world(stairs), step_height=0.13, max_slope=0.2) == FREE).all()
    steep = np.floor(np.clip(ACROSS - 5, 0, 12) / 2) * 0.2
    assert (projected(world(steep), step_height=0.13, max_slope=0.2) != FREE).any()


def test_a_hole_is_an_obstacle_on_the_floor_and_in_a_ramp():
    for height in (0.0 * ACROSS, ramp(0.25)):
        holed = height.copy()
        holed[22:25, 8:12] = np.nan
        state = projected(world(holed))
        assert (state[22:25, 8:12] == OCCUPIED).all()
        state[22:25, 8:12] = FREE
        assert (state == FREE).all()


def test_obstacles_and_overhangs_are_measured_from_the_ramp():
    cells = world(ramp(0.3))
    ground = ramp(0.3)[25, 0]  # 0.46 m: layer 9
    low, high = FLOOR + 5 + 3, FLOOR + 5 + 6
    assert math.floor(ground / 0.1 + 0.75) == 5
    cells.states[25, 5, low] = OCCUPIED  # a beam at 0.3 m above the ramp
    cells.states[25, 12, high] = OCCUPIED  # one at 0.6 m
    cells.states[5, 5, FLOOR + 6] = OCCUPIED  # at the height of neither, above the floor
    state = projected(cells)
    assert state[25, 5] == OCCUPIED
    state[25, 5] = FREE
    assert (state == FREE).all()


def test_a_deck_above_the_floor_is_no_ground_but_where_a_ramp_leads_there():
    cells = world(0.0 * ACROSS)
    cells.states[15:25, 5:15, FLOOR + 7] = OCCUPIED
    assert (projected(cells) == FREE).all()  # one walks below
    cells.states[15:25, 5:15, FLOOR : FLOOR + 7] = UNKNOWN  # nobody looked there
    assert (projected(cells)[15:25, 5:15] == UNKNOWN).all()


def naive(cells, step_height, max_slope, height, feet=None):
    """The definition, column by column; with the feet's column and layer."""
    foot = math.floor((step_height - LOW[2]) / 0.1 + 1e-6) - FLOOR
    tall = math.ceil((height - LOW[2]) / 0.1 - 1e-6) - FLOOR
    states = np.concatenate([cells.states, np.zeros((*SIZE, 24), np.uint8)], axis=2)
    limits = rises(step_height / 0.1, max_slope)

    def surface(c, z):
        return (
            0 <= z and states[c][z] == OCCUPIED and OCCUPIED not in states[c][z + foot : z + tall]
        )

    def near(c):
        around = [(c[0] + i, c[1] + j) for i, j in ((1, 0), (-1, 0), (0, 1), (0, -1))]
        return [a for a in around if 0 <= a[0] < SIZE[0] and 0 <= a[1] < SIZE[1]]

    columns = list(np.ndindex(*SIZE))
    ground = {c: FLOOR for c in columns if surface(c, FLOOR)}
    for c in columns if feet else ():
        away = max(abs(c[0] - feet[0]), abs(c[1] - feet[1]))
        if c in ground or away > BASELINE:
            continue
        layers = range(feet[2] - limits[1, away], feet[2] + limits[1, away] + 1)
        if surfaces := [z for z in layers if surface(c, z)]:
            ground[c] = surfaces[0]
    for reach in (limits[0, 1], None):
        while True:
            coming = {}
            for c in columns:
                if c in ground:
                    continue
                options = []
                for g in (ground[a] for a in near(c) if a in ground):
                    layers = [g] if reach is None else range(g - reach, g + reach + 1)
                    options += [z for z in layers if reach is None or surface(c, z)][:1]
                if options:
                    coming[c] = min(options)
            if not coming:
                break
            ground |= coming
        if reach is not None:
            seen = set(ground)
    result = np.zeros(SIZE, np.uint8)
    for c in columns:
        z, steep = ground.get(c, FLOOR), False
        for i, j in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
            way = [(c[0] + i * d, c[1] + j * d) for d in range(BASELINE + 1)]
            limit = limits[0 if i * j == 0 else 1]
            for d in range(1, BASELINE + 1):
                if c not in seen or way[d] not in seen:
                    break
                steep |= z - ground[way[d]] > limit[d]
                if abs(ground[way[d]] - ground[way[d - 1]]) > limit[1]:
                    break
        band = states[c][z + foot : z + tall]
        lowest = max(z - (0 if c in seen or not feet else limits[0, BASELINE]), 0)
        hole = FREE in states[c][:lowest] and not (c in seen and z != FLOOR)
        if hole or steep or OCCUPIED in band:
            result[c] = OCCUPIED
        elif OCCUPIED in states[c][z : z + foot] and (band == FREE).all():
            result[c] = FREE
    return result


def rough(seed):
    """A landscape of hills, cliffs and holes with noise, boards above and blind spots."""
    rng = np.random.default_rng(seed)
    x, y = np.indices(SIZE)
    height = 0.4 + 0.4 * np.sin(x / 7 + seed) * np.cos(y / 6) + 0.5 * (x > 30) * (seed % 2)
    height = np.where(x < 8, 0.0, height)
    height[rng.random(SIZE) < 0.01] = np.nan
    cells = world(height)
    noise = rng.random(cells.states.shape)
    cells.states[noise < 0.01] = OCCUPIED
    cells.states[noise > 0.99] = UNKNOWN
    return cells


@pytest.mark.parametrize("seed", range(2))
def test_it_is_the_slow_definition_and_a_map_that_is_followed_is_one_made_anew(seed):
    cells, other = rough(seed), rough(seed + 10)
    settings = [(0.03, 0.3, 0.45), (0.15, 0.2, 0.4)][seed % 2]
    config = CostmapConfig(max_slope=settings[1])
    body = config, cells, LOW, HIGH, "ground", 0.2, settings[2], settings[0]
    following = Costmap(*body)
    counts = np.zeros(3, int)
    for k in range(5):
        state = following.state[:, :, 0]
        np.testing.assert_array_equal(state, naive(cells, *settings))
        np.testing.assert_array_equal(following.clearance, Costmap(*body).clearance)
        np.testing.assert_array_equal(
            following.obstacle_clearance, Costmap(*body).obstacle_clearance
        )
        counts += np.bincount(state.ravel(), minlength=3)
        x, y = slice(7 * k, 7 * k + 9), slice(4 * k, 4 * k + 6)
        cells.set(np.s_[x, y], other.states[x, y])
        following.update(0.1)
    assert (counts > 100).all()


@pytest.mark.parametrize("seed", range(2))
def test_ground_is_also_found_from_the_feet(seed):
    cells, settings = rough(seed), [(0.03, 0.3, 0.45), (0.15, 0.2, 0.4)][seed % 2]
    cells.states[:, :, FLOOR] = UNKNOWN  # so that there is no floor
    config = CostmapConfig(max_slope=settings[1])
    body = config, cells, LOW, HIGH, "ground", 0.2, settings[2], settings[0]
    following, free = Costmap(*body), []
    for x in (12, 20, 33, -30, 200):
        height = (cells.states[np.clip(x, 0, 39), 11] == OCCUPIED).argmax() - FLOOR
        following.stand_at((0.1 * x + 0.05, 1.15, 0.1 * height - 0.02))
        following.update(0.1)
        state = following.state[:, :, 0]
        np.testing.assert_array_equal(state, naive(cells, *settings, (x, 11, height + FLOOR)))
        fresh = Costmap(*body)
        fresh.stand_at((0.1 * x + 0.05, 1.15, 0.1 * height - 0.02))
        fresh.update(0.1)
        np.testing.assert_array_equal(following.clearance, fresh.clearance)
        free.append(np.count_nonzero(state == FREE))
    assert max(free[:3]) > 100 > free[3] == free[4]
    with pytest.raises(ValueError, match="feet: got"):
        following.stand_at((0.0, math.nan, 0.0))


def test_what_lies_behind_a_crest_is_unknown_and_no_hole():
    height = ramp(0.25, top=0.5)
    cells, layers = world(height), np.arange(LAYERS)
    cells.states[30:] = np.where(layers >= FLOOR + 3, FREE, UNKNOWN)  # air beyond it
    costmap = Costmap(CostmapConfig(max_slope=0.3), cells, LOW, HIGH, "ground", 0.2, 0.45, 0.03)
    assert (costmap.state[30:] == OCCUPIED).all()
    costmap.stand_at((2.05, 1.15, float(height[20, 11])))
    costmap.update(0.1)
    assert (costmap.state[30:] == UNKNOWN).all()
    assert (costmap.state[:30] == FREE).all()
    cells.states[32:34, :, FLOOR + 1 :] = FREE  # deeper than any ramp
    cells.set(np.s_[32:34], cells.states[32:34])
    costmap.update(0.1)
    assert (costmap.state[32:34] == OCCUPIED).all()
    assert (costmap.state[34:] == UNKNOWN).all()


def test_on_a_flat_floor_nothing_differs():
    cells = world(0.0 * ACROSS)
    rng = np.random.default_rng(3)
    for x, y in rng.integers(2, 20, (12, 2)).tolist():
        height = int(rng.integers(2, 9))  # two cells and more: one may be a ramp
        cells.states[x : x + 3, y : y + 2, FLOOR : FLOOR + height + 1] = OCCUPIED
    cells.states[30:33, 4:9, FLOOR] = UNKNOWN
    cells.states[30:33, 12:14, :FLOOR] = FREE
    cells.states[30:33, 12:14, FLOOR] = UNKNOWN  # else flat floor that was seen holds
    np.testing.assert_array_equal(projected(cells), projected(cells, max_slope=0.0))


def test_limits_by_hand():
    axes, across = rises(0.3, 0.3)  # tan 0.3 = 0.309
    assert axes.tolist()[:5] == [1, 1, 1, 2, 2]  # 0.309 (d + 1), but 0.3 + 0.309 d if more
    assert axes[BASELINE] == 3
    assert across[BASELINE] == math.ceil(0.309336 * math.sqrt(2.0) * 9)
    assert rises(1.0, 0.0)[0].tolist() == [1] * 9


def test_a_ramp_that_is_swept_from_below_is_walked_over():
    """A lidar of 120 rows at 0.6 m that comes up to a ramp and looks at it."""
    rows, columns = np.linspace(-50.0, 25.0, 120), np.linspace(-60.0, 60.0, 250)
    directions = scan(np.deg2rad(rows), np.deg2rad(columns))
    config = MapConfig(resolution=0.05, half_life=0.0, memory_mib=64)
    voxel_map = VoxelMap(config)
    foot, slope = 2.0, math.tan(0.3)
    rng = np.random.default_rng(5)
    for k in range(20):
        origin = np.array([0.05 * k, 0.02, 0.6])
        with np.errstate(divide="ignore", invalid="ignore"):
            floor = np.where(directions[:, 2] < 0, -origin[2] / directions[:, 2], np.inf)
            climb = directions[:, 2] - slope * directions[:, 0]
            plane = np.where(climb < 0, (slope * (origin[0] - foot) - origin[2]) / climb, np.inf)
        on_ramp = origin[0] + plane * directions[:, 0] > foot
        ranges = np.where(on_ramp & (plane > 0), np.minimum(plane, 99.0), floor)
        ranges = ranges + rng.normal(0.0, 0.005, len(ranges))
        ranges_mm = np.where(ranges < 5.0, np.rint(1000 * np.minimum(ranges, 9.0)), 65535)
        voxel_map.integrate(origin, directions, ranges_mm.astype(np.uint16), 5.0, k)
    window = (0.0, -1.0, -0.3), (4.0, 1.0, 2.5)
    for max_slope, walked in ((0.35, True), (0.0, False)):
        config = CostmapConfig(max_slope=max_slope)
        costmap = Costmap(config, voxel_map, *window, "ground", 0.2, 0.5, 0.03)
        on_ramp = costmap.state[44:64, 12:28, 0]  # 2.2 to 3.2 m
        assert ((on_ramp == FREE).mean() > 0.95) == walked
