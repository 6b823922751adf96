"""Free space, bodies in it, and the frontier of what is known."""

import dataclasses
import hashlib
import itertools
import math

import numpy as np
import pytest

from tests.planners.worlds import (
    LONG,
    long_space,
    make_space,
    point,
    random_points,
    random_space,
    row_of_cells,
)
from wayproof.maps import collision_distance_sq
from wayproof.planners import (
    STATE_SPACES,
    Body,
    Disc,
    FreeSpace,
    PlannerConfig,
    best_frontier,
    plan,
    plan_seed,
    point_at,
    state_space_for,
    truncate,
)
from wayproof.planners.kernels import angles


def test_every_point_before_the_free_length_is_free():
    rng = np.random.default_rng(5)
    cut = 0
    for seed in range(40):
        space = random_space(seed, (12, 12, 6))
        path = random_points(rng, space, 4)
        length = space.free_length(path)
        cut += 0.0 < length < np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
        if length > 0.0:
            assert all(space.is_free(point_at(path, s)) for s in np.linspace(0.0, length, 300))
    assert cut > 5


def test_outside_and_senseless_points_are_forbidden():
    space = row_of_cells([4, 4])
    for x in (-1e-9, 2.0, 1e9, math.inf, math.nan):
        away = np.array([x, 0.5, 0.5])
        assert not space.is_free(away)
        assert not space.edge_free(np.array([0.5, 0.5, 0.5]), away)
    assert space.is_free(np.zeros(3))
    path = np.array([[1.5, 0.5, 0.5], [2.5, 0.5, 0.5]])
    assert space.free_length(path) == pytest.approx(0.5, abs=1e-4)
    assert space.least_clearance(path) == 0.0
    assert space.free_length(path[::-1]) == 0.0


def test_nearest_free_takes_the_nearest_then_the_lowest_index():
    field = np.full((5, 5, 1), 9, dtype=np.uint16)
    field[1:4, 1:4] = 0
    space = FreeSpace(field, np.zeros(3), 1.0, 0, np.zeros(10))
    # From the centre four cells are 2 m away: (0, 2), (2, 0), (2, 4), (4, 2).
    assert space.nearest_free(np.array([2.5, 2.5, 0.5]), 2.0).tolist() == [0.5, 2.5, 0.5]
    assert space.nearest_free(np.array([2.5, 2.6, 0.5]), 2.0).tolist() == [2.5, 4.5, 0.5]
    assert space.nearest_free(np.array([2.5, 2.5, 0.5]), 1.9) is None
    assert space.nearest_free(np.array([-0.5, 0.5, 0.5]), 1.0).tolist() == [0.5, 0.5, 0.5]
    assert space.nearest_free(np.array([math.nan, 0.5, 0.5]), 1.0) is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"distances": np.zeros((3, 3), dtype=np.uint16)},
            r"space\.distances: got uint16 \(3, 3\)",
        ),
        ({"origin": np.zeros(2)}, r"space\.origin: got shape \(2,\), expected \(3,\)"),
        ({"resolution": 0.0}, r"space\.resolution: got 0\.0, expected above 0"),
        ({"collision_distance_sq": -1}, r"collision_distance_sq: got -1, expected 0 or more"),
        ({"cost_by_distance": np.array([0.0, np.inf])}, r"space\.cost_by_distance: got \[inf\]"),
    ],
)
def test_wrong_spaces_are_refused(change, message):
    right = {
        "distances": np.ones((3, 3, 1), dtype=np.uint16),
        "origin": np.zeros(3),
        "resolution": 0.1,
        "collision_distance_sq": 0,
        "cost_by_distance": np.zeros(4),
    }
    with pytest.raises(ValueError, match=message):
        FreeSpace(**(right | change))


def test_a_way_cut_short_at_a_corner_of_cells_ends_in_a_free_cell():
    """A diagonal through the corner of a blocked cell, its ends off by what floats round to."""
    field = np.full((200, 200, 1), 100, dtype=np.uint16)
    field[97, 79, 0] = 0
    space = FreeSpace(field, np.array([0.0, 0.0, 0.025]), 0.1, 1, np.zeros(101))
    for off in itertools.product((-4e-15, 0.0, 4e-15), repeat=4):
        a = np.array([9.65 + off[0], 7.85 + off[1], 0.075])
        b = np.array([10.65 + off[2], 8.85 + off[3], 0.075])
        path = np.array([a, b])
        cut = truncate(path, space.free_length(path))
        assert space.edge_free(cut[0], cut[-1])


def test_thresholds_by_hand():
    # 0.25 m are 5 cells of 5 cm, and half a diagonal is 0.707 or 0.866 of one: 32.57 and 34.41.
    assert collision_distance_sq(0.25, 0.05, flat=True) == 32
    assert collision_distance_sq(0.25, 0.05, flat=False) == 34
    body = Body((0.0, 0.4), (0.2, 0.1))
    assert body.circumscribed_radius == pytest.approx(0.5)
    assert body.discs(0.05, 0.05, flat=True) == (Disc(0.0, 32), Disc(0.4, 13))


@pytest.mark.parametrize(
    ("offsets", "radii", "message"),
    [
        ((), (), r"body: got 0 offsets and 0 radii"),
        ((0.0,), (0.1, 0.2), r"body: got 1 offsets and 2 radii"),
        ((0.0,), (0.0,), r"body\.radii: got \(0\.0,\), expected above 0"),
        ((math.nan,), (0.1,), r"body\.offsets: got \(nan,\)"),
    ],
)
def test_wrong_bodies_are_refused(offsets, radii, message):
    with pytest.raises(ValueError, match=message):
        Body(offsets, radii)
    with pytest.raises(ValueError, match=r"space\.discs: got a least threshold of 9"):
        dataclasses.replace(make_space(np.zeros((9, 9, 1), bool)), discs=(Disc(0.0, 9),))


@pytest.mark.parametrize("name", ["astar", "rrtconnect"])
def test_a_long_body_fits_lengthwise_where_its_disc_does_not(gap, name):
    start, goal = point(gap, 15.5, 30.5), point(gap, 65.5, 30.5)
    disc = collision_distance_sq(LONG.circumscribed_radius, gap.resolution, flat=True)
    round_body = dataclasses.replace(gap, discs=(), collision_distance_sq=disc)
    config = PlannerConfig(name, iterations=20_000)
    assert plan(round_body, start, goal, config, seed=1).label == "no_path"
    found = plan(gap, start, goal, config, seed=1, heading=1.5)
    assert found.label == "none"
    poses = np.column_stack((found.waypoints, found.headings))
    assert np.array_equal(poses[0], [*start, 1.5])
    assert gap.sweep_cost(poses) == found.cost < math.inf
    assert gap.free_sweep_length(poses) == pytest.approx(found.length)
    inside = np.abs(poses[:, 0] - point(gap, 40, 0)[0]) < 0.3
    assert np.all(np.abs(np.sin(poses[inside, 3])) < 0.5)


def test_a_blocked_heading_is_reported(gap):
    beside = point(gap, 32.5, 10.5)  # 0.3 m from the wall: along it is free, across is not
    goal = point(gap, 10.5, 30.5)
    assert plan(gap, beside, goal, PlannerConfig(), 1, heading=0.0).label == "start_blocked"
    assert plan(gap, beside, goal, PlannerConfig(), 1, heading=math.pi / 2).label == "none"
    assert plan(gap, goal, beside, PlannerConfig(), 1, goal_heading=0.0).label == "goal_blocked"
    to_wall = plan(gap, goal, beside, PlannerConfig(), 1)
    assert abs(math.sin(to_wall.headings[-1])) > 0.5


@pytest.mark.parametrize("curve", ["reeds_shepp", "dubins"])
def test_curves_keep_the_turning_radius(curve):
    space = long_space(np.zeros((80, 60, 1), dtype=bool))
    config = PlannerConfig("rrtconnect", state_space=curve, turning_radius=0.6, restarts=1)
    found = plan(space, point(space, 20.5, 20.5), point(space, 60.5, 40.5), config, 3, heading=2.0)
    poses = np.column_stack((found.waypoints, found.headings))
    turns = np.abs([angles.wrap(turn) for turn in np.diff(found.headings)])
    lengths = np.linalg.norm(np.diff(found.waypoints, axis=0), axis=1)
    sharp = turns > lengths / 0.6 * 1.001 + 1e-6
    assert space.sweep_cost(poses) == found.cost
    steps, ahead = (
        np.diff(found.waypoints, axis=0),
        found.headings[:-1] + 0.5 * np.diff(np.unwrap(found.headings)),
    )
    forward = steps[:, 0] * np.cos(ahead) + steps[:, 1] * np.sin(ahead)
    # A step over a cusp, where the motion turns round, is cut short; Dubins paths have none.
    cusps = np.count_nonzero(np.diff(np.sign(forward)))
    assert np.count_nonzero(sharp) <= cusps
    assert np.abs(forward)[~sharp] == pytest.approx(lengths[~sharp], rel=1e-2, abs=1e-6)
    assert curve == "reeds_shepp" or forward.min() > -1e-9


def test_a_body_of_balls_flies_through_a_slot():
    blocked = np.zeros((50, 40, 20), dtype=bool)
    blocked[22:28] = True
    blocked[22:28, 15:25, 6:14] = False
    space = long_space(blocked)
    start, goal = point(space, 8.5, 20.5, 10.5), point(space, 42.5, 20.5, 10.5)
    for name in ("astar", "rrtconnect"):
        found = plan(space, start, goal, PlannerConfig(name, 20_000), seed=2, heading=1.0)
        poses = np.column_stack((found.waypoints, found.headings))
        assert space.sweep_cost(poses) == found.cost < math.inf


def test_what_does_not_suit_a_body_is_refused(gap):
    start, goal = point(gap, 15.5, 30.5), point(gap, 25.5, 30.5)
    with pytest.raises(ValueError, match=r"state_space: got position for a body of discs"):
        plan(gap, start, goal, PlannerConfig(state_space="position"), seed=1)
    solid = make_space(np.zeros((20, 20, 20), dtype=bool))
    curved = PlannerConfig("rrtconnect", state_space="dubins")
    with pytest.raises(ValueError, match=r"state_space: got dubins in space"):
        plan(solid, start, goal, curved, seed=1)
    with pytest.raises(
        ValueError, match=r"got dubins for the planner aorrtc, expected reeds_shepp"
    ):
        state_space_for("dubins", "aorrtc", flat=True, discs=False)
    start, goal = point(solid, 4.5, 10.5, 10.5), point(solid, 15.5, 10.5, 10.5)
    for name in ("informed_rrtstar", "bitstar", "aorrtc", "kpiece1"):
        headed = PlannerConfig(name, state_space="pose", iterations=100)
        with pytest.raises(ValueError, match=f"pose in space for the planner {name}, expected pos"):
            plan(solid, start, goal, headed, seed=1)
    for name in ("astar", "rrtconnect", "rrtstar", "fmt"):
        headed = PlannerConfig(name, state_space="pose", iterations=100)
        assert plan(solid, start, goal, headed, seed=1).label in ("none", "no_path")
    assert set(STATE_SPACES) == {"position", "pose", "reeds_shepp", "dubins"}


NOWHERE = np.empty((0, 3))


def space(free):
    """A flat space of 10 cm cells, free where given."""
    field = np.where(free, 100, 0).astype(np.uint16)[:, :, None]
    return FreeSpace(field, np.zeros(3), 0.1, 4, np.zeros(101))


def at(x, y):
    return np.array([0.1 * x + 0.05, 0.1 * y + 0.05, 0.05])


@pytest.fixture
def corridor():
    """Ten free cells in a row, then unknown ones up to a goal; all else is blocked."""
    admitted, passable = np.zeros((20, 5), bool), np.zeros((20, 5), bool)
    admitted[2:12, 2] = True
    passable[1:19, 2] = True
    return admitted, passable


def test_the_frontier_towards_the_goal_comes_first(corridor):
    chosen = best_frontier(*map(space, corridor), at(5, 2), at(18, 2), NOWHERE)
    np.testing.assert_allclose(chosen, at(11, 2))


def test_a_visited_frontier_leaves_the_other_end(corridor):
    visited = np.vstack([at(11, 2), np.full(3, np.inf)])
    chosen = best_frontier(*map(space, corridor), at(5, 2), at(18, 2), visited)
    np.testing.assert_allclose(chosen, at(2, 2))


def test_no_frontier_where_all_is_known_or_out_of_reach(corridor):
    admitted, passable = corridor
    assert best_frontier(space(admitted), space(admitted), at(5, 2), at(18, 2), NOWHERE) is None
    assert best_frontier(space(admitted), space(passable), at(0, 0), at(18, 2), NOWHERE) is None
    admitted[8, 2] = passable[8, 2] = False  # a wall: only the end on this side is in reach
    chosen = best_frontier(space(admitted), space(passable), at(5, 2), at(18, 2), NOWHERE)
    np.testing.assert_allclose(chosen, at(2, 2))


def test_seeds_are_named_draws():
    assert plan_seed(1, "plan", 2) == plan_seed(1, "plan", 2)
    seeds = {plan_seed(e, s, n) for e in range(9) for s in ("plan", "explore") for n in range(50)}
    assert len(seeds) == 9 * 2 * 50
    assert min(seeds) >= 1
    assert max(seeds) < 2**31
    # BLAKE2b, 8 bytes of "7/plan/0", little-endian, modulo 2^31 - 1, plus 1
    expected = hashlib.blake2b(b"7/plan/0", digest_size=8).digest()
    assert plan_seed(7, "plan", 0) == int.from_bytes(expected, "little") % (2**31 - 1) + 1
