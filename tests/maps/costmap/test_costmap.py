import math

import numpy as np
import pytest
from scipy import ndimage

from tests.maps.exact_distances import scipy_squared
from wayproof.maps import FREE, OCCUPIED, UNKNOWN, Costmap, CostmapConfig
from wayproof.maps.columns import ColumnMap
from wayproof.maps.kernels import columns as kernels

LOW, HIGH = (0.0, 0.0, -0.375), (3.0, 2.0, 1.125)  # layers of 0.1 m; the floor's is layer 3
FLOOR, BODY = 3, slice(5, 8)  # band of a body between 0.15 and 0.4 m: 0.125 to 0.425 m


class StateArray(ColumnMap):
    """States of a box of cells of the map; what lies outside it is unknown.

    Cell (i, j, k) of the box is cell `first` + (i, j, k) of the map.
    """

    resolution = 0.1

    def __init__(self, states, first=(0, 0, -3)):
        self.states = states
        self.first = np.array(first)
        self._log = []  # a box for each change

    def set(self, where, state):
        """Change cells, and log the box that holds them."""
        self.states[where] = state
        touched = np.zeros(self.states.shape, np.bool_)
        touched[where] = True
        cells = np.argwhere(touched) + self.first
        self._log.append([*cells.min(axis=0), *(cells.max(axis=0) + 1)])

    def changed(self, since):
        everything = [[*self.first, *(self.first + self.states.shape)]]
        boxes = everything if since == 0 else self._log[since - 1 :]
        return np.array(boxes, np.int64).reshape(-1, 6), len(self._log) + 1

    def columns(self, low_cell, shape):
        nx, ny, words = shape
        part = np.full((nx, ny, 64 * words), UNKNOWN, np.uint8)
        start = np.array(low_cell) - self.first
        low = np.maximum(start, 0)
        high = np.maximum(np.minimum(start + part.shape, self.states.shape), low)
        here = tuple(slice(a, b) for a, b in zip(low, high, strict=True))
        there = tuple(slice(a, b) for a, b in zip(low - start, high - start, strict=True))
        part[there] = self.states[here]
        weights = np.uint64(1) << np.arange(64, dtype=np.uint64)
        return tuple(
            ((part == state).reshape(nx, ny, words, 64) * weights).sum(axis=3, dtype=np.uint64)
            for state in (OCCUPIED, FREE)
        )


def traversable(costmap):
    """Where the body's centre may be under the policy, (nx, ny, nz)."""
    return costmap.field() > costmap.collision_distance_sq


@pytest.fixture
def voxel_map():
    """Known throughout: a floor with free space above and nothing known below."""
    states = np.full((30, 20, 15), UNKNOWN, np.uint8)
    states[:, :, FLOOR] = OCCUPIED
    states[:, :, FLOOR + 1 :] = FREE
    return StateArray(states)


def ground(voxel_map, low=LOW, high=HIGH, **config):
    config = CostmapConfig(**config)
    return Costmap(config, voxel_map, low, high, "ground", 0.2, height=0.4, step_height=0.15)


def air(voxel_map, low=LOW, high=HIGH, floor=-math.inf, ceiling=math.inf, **config):
    config = CostmapConfig(localization_margin=0.0, **config)
    return Costmap(config, voxel_map, low, high, "air", 0.2, 0.2, 0.0, floor, ceiling)


def assert_distances_are_exact(costmap):
    reach = math.isqrt(costmap.truncation)
    np.testing.assert_array_equal(costmap.clearance, scipy_squared(costmap.state != FREE, reach))
    np.testing.assert_array_equal(
        costmap.obstacle_clearance, scipy_squared(costmap.state == OCCUPIED, reach)
    )
    assert costmap.clearance.max() <= costmap.truncation


@pytest.mark.parametrize(
    ("change", "state"),
    [
        ({}, FREE),
        ({BODY.start: OCCUPIED}, OCCUPIED),  # an obstacle just above the step height
        ({BODY.stop - 1: OCCUPIED}, OCCUPIED),  # at the height of the back
        ({BODY.stop: OCCUPIED}, FREE),  # an overhang
        ({FLOOR + 1: OCCUPIED}, FREE),  # a step
        ({FLOOR: UNKNOWN, FLOOR + 1: OCCUPIED}, FREE),  # standing on the step alone
        ({FLOOR: UNKNOWN}, UNKNOWN),  # no floor was seen
        ({FLOOR: FREE}, UNKNOWN),
        ({FLOOR: UNKNOWN, 0: FREE}, OCCUPIED),  # a beam went through where the floor should be
        ({FLOOR - 1: FREE}, FREE),  # floor that was seen holds
        ({BODY.start: UNKNOWN}, UNKNOWN),  # never seen in the band
        ({BODY.start: UNKNOWN, BODY.stop - 1: OCCUPIED}, OCCUPIED),
    ],
)
def test_the_state_of_a_column(voxel_map, change, state):
    for layer, value in change.items():
        voxel_map.set(np.s_[20, 10, layer], value)
    costmap = ground(voxel_map)
    assert costmap.shape == (30, 20, 1)
    assert costmap.state[20, 10, 0] == state
    assert np.count_nonzero(costmap.state != FREE) == (state != FREE)


def test_the_body_is_forbidden_near_what_the_policy_fears(voxel_map):
    voxel_map.set(np.s_[10, 10, BODY], OCCUPIED)
    voxel_map.set(np.s_[20, 10, BODY], UNKNOWN)
    forbid, allow = ground(voxel_map), ground(voxel_map, unknown_policy="allow")
    # (0.2 + 0.1) m is 3 cells, and half a diagonal 0.707: 3.707^2 = 13.7.
    assert forbid.collision_distance_sq == allow.collision_distance_sq == 13
    assert traversable(forbid)[[10, 10, 20, 20], [13, 14, 13, 14], 0].tolist() == [False, True] * 2
    assert traversable(allow)[[10, 20, 20], [13, 10, 13], 0].tolist() == [False, True, True]
    # The border is 3 cells from index 2, which is too near, and 4 from index 3.
    assert traversable(forbid)[2:4, 10, 0].tolist() == [False, True]
    assert np.shares_memory(forbid.field(), forbid.clearance)
    assert ground(voxel_map, unknown_policy="penalize").field().max() > 13


@pytest.mark.parametrize("unknown", [0.0, 0.1])
def test_fields_are_exact_distances(voxel_map, unknown):
    draw = np.random.default_rng(2).random(voxel_map.states.shape)
    voxel_map.set(np.s_[draw < unknown + 0.005], UNKNOWN)
    voxel_map.set(np.s_[draw < 0.005], OCCUPIED)
    assert_distances_are_exact(ground(voxel_map))
    assert_distances_are_exact(air(voxel_map))


@pytest.mark.parametrize("make", [ground, air])
@pytest.mark.parametrize(
    ("low", "high"),
    [
        ((-1.0, -0.5, -0.375), (0.8, 0.4, 1.0)),  # partly outside the map
        ((2.0, 1.0, -0.6), (3.5, 2.5, 6.4)),  # two words of cells high
        ((0.5, 0.7, -0.1), (1.9, 1.1, 0.9)),  # within it
        ((-9.0, -9.0, -0.375), (-8.0, -8.0, 1.0)),  # wholly outside
    ],
)
def test_a_window_shows_its_part_of_the_map(voxel_map, make, low, high):
    draw = np.random.default_rng(3).random(voxel_map.states.shape)
    voxel_map.set(np.s_[draw < 0.01], OCCUPIED)
    whole = make(voxel_map, (-10.0, -10.0, -0.6), (10.0, 10.0, 6.4))
    costmap = make(voxel_map, low, high)
    first = np.round((costmap.origin - whole.origin) / 0.1).astype(int)
    part = tuple(slice(a, a + n) for a, n in zip(first, costmap.shape, strict=True))
    np.testing.assert_array_equal(costmap.state, whole.state[part])
    assert_distances_are_exact(costmap)


@pytest.mark.parametrize("make", [ground, air])
def test_updates_equal_a_new_costmap(voxel_map, make):
    rng = np.random.default_rng(4)
    costmap = make(voxel_map)
    for step in range(24):
        for _ in range(step % 3):  # at times nothing changes
            x, y, z = (rng.integers(0, n) for n in voxel_map.states.shape)
            state = rng.choice([UNKNOWN, FREE, OCCUPIED])
            voxel_map.set(np.s_[x : x + 5, y : y + 5, z : z + rng.integers(1, 9)], state)
        margin = 0.05 * rng.integers(0, 8)  # moves the reach up and down
        costmap.update(margin)
        fresh = make(voxel_map)
        fresh.update(margin)
        assert costmap.truncation == fresh.truncation
        for name in ("state", "clearance", "obstacle_clearance", "cost_table"):
            np.testing.assert_array_equal(getattr(costmap, name), getattr(fresh, name))
        if step % 8 == 0:
            assert_distances_are_exact(costmap)


def test_the_air_has_the_states_of_the_voxels_within_the_window(voxel_map):
    costmap = air(voxel_map, floor=0.2, ceiling=0.9)
    # Whole layers only: 0.225 to 0.825 m.
    assert costmap.shape == (30, 20, 6)
    assert costmap.origin[2] == pytest.approx(0.225)
    assert np.all(costmap.state == FREE)
    assert costmap.clearance[15, 10].ravel().tolist() == [1, 4, 9, 9, 4, 1]
    np.testing.assert_array_equal(costmap.clearance, costmap.obstacle_clearance)
    np.testing.assert_array_equal(air(voxel_map).state, voxel_map.states)


def test_the_ball_keeps_half_a_space_diagonal(voxel_map):
    # 0.2 m is 2 cells, and half a diagonal 0.866: 2.866^2 = 8.2.
    assert air(voxel_map).collision_distance_sq == 8


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
    voxel_map.set(np.s_[15, 10, BODY], OCCUPIED)
    costmap = ground(voxel_map)
    before = traversable(costmap).sum()
    costmap.update(0.3)
    assert costmap.collision_distance_sq == 32  # (5 + 0.707)^2 = 32.6
    assert costmap.margin == 0.3
    assert traversable(costmap).sum() < before
    costmap.update(0.1)
    assert traversable(costmap).sum() == before


@pytest.mark.parametrize(
    ("motion", "body", "message"),
    [
        ("water", {}, "motion: got 'water', expected one of ground, air"),
        ("ground", {"radius": 0.0}, "radius: got 0"),
        ("ground", {"radius": math.nan}, "radius: got nan"),
        ("ground", {"height": 1.5}, "height: got 1.5, expected up to the window's top, 1.125 m"),
        ("ground", {"step_height": 0.5}, "step_height: got 0.5, expected 0 to below the height"),
        ("ground", {"step_height": 0.01}, "step_height: got 0.01 m with cells of"),
        ("ground", {"radius": 20.0}, "expected at most 181"),
        ("air", {"floor": 2.0}, "floor, ceiling: got 2 to inf"),
        ("air", {"floor": 0.3, "ceiling": 0.35}, "floor, ceiling: got 0.3 to 0.35"),
    ],
)
def test_a_body_that_does_not_fit_is_refused(voxel_map, motion, body, message):
    body = {"radius": 0.2, "height": 0.4, "step_height": 0.15} | body
    with pytest.raises(ValueError, match=message):
        Costmap(CostmapConfig(), voxel_map, LOW, HIGH, motion, **body)


@pytest.mark.parametrize("margin", [-0.1, math.nan, math.inf])
def test_a_bad_margin_is_refused(voxel_map, margin):
    with pytest.raises(ValueError, match="margin: got"):
        ground(voxel_map).update(margin)


@pytest.fixture
def pillar(voxel_map):
    """An airspace with one occupied cell: indices (15, 10, 10)."""
    voxel_map.set(np.s_[:], FREE)
    voxel_map.set(np.s_[15, 10, 10], OCCUPIED)
    return air(voxel_map)


def centre(costmap, *cell):
    return costmap.origin + (np.array(cell) + 0.5) * costmap.resolution


def test_clearance_in_metres_at_cells_and_between_them(pillar):
    places = [centre(pillar, 15, 10, 10), centre(pillar, 17, 10, 10), centre(pillar, 17, 11, 10)]
    np.testing.assert_allclose(
        pillar.clearance_at([*places, (places[1] + places[2]) / 2]),
        [0.0, 0.2, 0.1 * math.sqrt(5), 0.05 * (2.0 + math.sqrt(5))],
        atol=1e-12,
    )
    outside = [[-1.0, 1.0, 0.5], [1.0, 1.0, 99.0], [np.nan, 1.0, 0.5], [np.inf, 1.0, 0.5]]
    assert pillar.clearance_at(outside).tolist() == [0.0] * 4
    assert pillar.gradient_at(outside).tolist() == [[0.0] * 3] * 4


def test_the_gradient_leads_away_at_a_metre_per_metre(pillar):
    along_x = centre(pillar, 16.5, 10, 10)
    np.testing.assert_allclose(pillar.gradient_at([along_x])[0, 0], 1.0, rtol=1e-9)
    points = np.random.default_rng(5).uniform([0.3, 0.3, 0.0], [2.7, 1.7, 0.9], (200, 3))
    # Not on a face between interpolated cubes, where the gradient jumps.
    shares = (points - pillar.origin) / pillar.resolution - 0.5
    points = points[np.all(np.abs(shares - np.round(shares)) > 1e-4, axis=1)]
    step = 1e-6
    for axis in range(3):
        ahead, behind = points.copy(), points.copy()
        ahead[:, axis] += step
        behind[:, axis] -= step
        difference = (pillar.clearance_at(ahead) - pillar.clearance_at(behind)) / (2.0 * step)
        np.testing.assert_allclose(pillar.gradient_at(points)[:, axis], difference, atol=1e-6)


def test_on_the_ground_height_does_not_matter(voxel_map):
    voxel_map.set(np.s_[15, 10, BODY], OCCUPIED)
    costmap = ground(voxel_map)
    low, high = centre(costmap, 17, 10, -0.4), centre(costmap, 17, 10, 0.4)
    np.testing.assert_allclose(costmap.clearance_at([low, high]), 0.2, atol=1e-12)
    assert np.all(costmap.gradient_at([low, high])[:, 2] == 0.0)


@pytest.mark.parametrize("query", ["clearance_at", "gradient_at"])
def test_points_of_another_shape_are_refused(pillar, query):
    with pytest.raises(ValueError, match=r"points: got shape \(1, 2\), expected \(n, 3\)"):
        getattr(pillar, query)([[1.0, 2.0]])


def test_compiled_kernels_equal_their_python(voxel_map, monkeypatch):
    draw = np.random.default_rng(8).random(voxel_map.states.shape)
    voxel_map.set(np.s_[draw < 0.1], UNKNOWN)
    voxel_map.set(np.s_[draw < 0.01], OCCUPIED)
    voxel_map.set(np.s_[draw > 0.98], FREE)
    points = np.random.default_rng(9).uniform(-0.2, 2.2, (60, 3))

    def everything():
        answers = []
        for costmap in (ground(voxel_map), air(voxel_map)):
            answers += [costmap.state, costmap.clearance_at(points)]
            answers.append(costmap.gradient_at(points))
        return answers

    compiled = everything()
    for name in ("project_columns", "is_hole", "is_edge", "interpolate", "neighbours"):
        monkeypatch.setattr(kernels, name, getattr(kernels, name).py_func)
    for ours, theirs in zip(compiled, everything(), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_columns_across_words_are_projected_one_by_one():
    """150 columns along y lie in three words; boxes that begin and end within them change some."""
    rng = np.random.default_rng(5)
    states = np.full((6, 150, 15), FREE, np.uint8)
    states[:, :, :FLOOR] = UNKNOWN
    states[:, :, FLOOR] = OCCUPIED
    wide = StateArray(states)
    costmap = ground(wide, high=(0.6, 15.0, 1.125))
    for y0, y1 in ((0, 150), (60, 70), (63, 64), (64, 128), (100, 150)):
        odd = rng.random((6, y1 - y0, 15)) < 0.1
        drawn = rng.choice([FREE, OCCUPIED, UNKNOWN], odd.shape)
        wide.set(np.s_[:, y0:y1, :], np.where(odd, drawn, states[:, y0:y1]))
        costmap.update(0.0)
        band = states[:, :, BODY]
        stands = (states[:, :, FLOOR : BODY.start] == OCCUPIED).any(axis=2)
        through = (states[:, :, :FLOOR] == FREE).any(axis=2)
        edge = ndimage.binary_dilation(through & ~stands, np.ones((3, 3)))
        blocked = (band == OCCUPIED).any(axis=2) | (through & edge)
        clear = stands & (band == FREE).all(axis=2) & ~blocked
        expected = np.where(blocked, OCCUPIED, np.where(clear, FREE, UNKNOWN))
        np.testing.assert_array_equal(costmap.state[:, :, 0], expected)


def test_floor_that_was_seen_holds_where_beams_went_below_it(voxel_map):
    """But at the edge of a hole, corners too; the costmap follows what the neighbours change."""
    config, body = CostmapConfig(), (LOW, HIGH, "ground", 0.2, 0.4, 0.15)
    following = Costmap(config, voxel_map, *body)
    rng = np.random.default_rng(12)
    for _ in range(30):
        x, y = rng.integers((0, 0), (29, 19))
        part = np.s_[x : x + 2, y : y + 2, rng.choice([FLOOR - 1, FLOOR])]
        voxel_map.set(part, rng.choice([FREE, OCCUPIED, UNKNOWN], p=[0.6, 0.2, 0.2]))
        following.update(following.margin)
        states = voxel_map.states
        through = (states[:, :, :FLOOR] == FREE).any(axis=2)
        seen = (states[:, :, FLOOR : BODY.start] == OCCUPIED).any(axis=2)
        holes = np.argwhere(through & ~seen)
        apart = np.abs(np.argwhere(np.ones_like(seen))[:, None] - holes[None]).max(axis=2)
        edge = (apart.min(axis=1, initial=9) <= 1).reshape(seen.shape)
        expected = np.where(through & edge, OCCUPIED, np.where(seen, FREE, UNKNOWN))
        np.testing.assert_array_equal(following.state[:, :, 0], expected)
        whole = Costmap(config, voxel_map, *body)
        np.testing.assert_array_equal(following.clearance, whole.clearance)
    assert (through & seen & ~edge).any()
    assert (through & seen & edge).any()


@pytest.mark.parametrize("motion", ["ground", "air"])
def test_a_moved_window_is_as_a_new_costmap_of_it(motion):
    rng = np.random.default_rng(11)
    states = np.full((90, 60, 15), FREE, np.uint8)
    states[:, :, FLOOR] = OCCUPIED
    source = StateArray(states)

    def make(low, high):
        config = CostmapConfig(localization_margin=0.02)
        return Costmap(config, source, low, high, motion, 0.15, 0.4, 0.15, 0.05, 1.1)

    kept = make((0.0, 0.0, -0.375), (3.0, 2.0, 1.125))
    for _ in range(6):
        low = np.array([*rng.integers(0, (55, 35)) * 0.1, -0.375])
        high = np.add(low, (3.0, 2.4, 1.5))
        kept.move(low, high)
        for _ in range(2):  # at once, and after another change
            part = tuple(slice(a, a + 6) for a in rng.integers(0, (84, 54, 12)))
            source.set(part, rng.choice([OCCUPIED, UNKNOWN, FREE]))
            kept.update(0.02)
            new = make(low, high)
            assert kept.shape == new.shape
            np.testing.assert_array_equal(kept.origin, new.origin)
            np.testing.assert_array_equal(kept.state, new.state)
            np.testing.assert_array_equal(kept.clearance, new.clearance)
            np.testing.assert_array_equal(kept.obstacle_clearance, new.obstacle_clearance)
