import dataclasses
import math

import numpy as np
import pytest

from tests.planners.worlds import make_space, point
from wayproof.planners import (
    STATE_SPACES,
    Body,
    Disc,
    FreeSpace,
    GoalField,
    PlannerConfig,
    collision_distance_sq,
    plan,
    state_space_for,
)
from wayproof.planners.kernels import angles, pose_shortcut, sweep_cost

LONG = Body(offsets=(-0.3, 0.0, 0.3), radii=(0.2, 0.2, 0.2))


def body_space(blocked: np.ndarray, body: Body = LONG) -> FreeSpace:
    space = make_space(blocked)
    discs = body.discs(margin=0.0, resolution=space.resolution, flat=space.flat)
    least = min(disc.collision_distance_sq for disc in discs)
    return dataclasses.replace(space, collision_distance_sq=least, discs=discs)


@pytest.fixture(scope="module")
def gap() -> FreeSpace:
    """A wall of 1 m with a gap of 0.9 m: the disc about the body, of 1 m across, does not fit."""
    blocked = np.zeros((80, 60, 1), dtype=bool)
    blocked[35:45] = True
    blocked[35:45, 26:35] = False
    return body_space(blocked)


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


def test_directions_equal_the_library_and_python():
    for angle in np.random.default_rng(0).uniform(-20.0, 20.0, 200):
        found = angles.cosine_sine(angle)
        assert found == pytest.approx((math.cos(angle), math.sin(angle)), abs=1e-13)
        assert angles.cosine_sine.py_func(angle) == found


def random_poses(space: FreeSpace, count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    cells = rng.uniform(5.0, 55.0, (count, 2))
    points = np.array([point(space, x, y) for x, y in cells])
    return np.column_stack((points, rng.uniform(-4.0, 4.0, count)))


def naive_free(space: FreeSpace, a: np.ndarray, b: np.ndarray) -> bool:
    """Every disc's centre at 400 poses between lies in a free cell of its own."""
    turn = (b[3] - a[3] + math.pi) % (2.0 * math.pi) - math.pi
    for t in np.linspace(0.0, 1.0, 400):
        x, y, z, heading = *(a[:3] + t * (b[:3] - a[:3])), a[3] + t * turn
        for disc in space.discs:
            centre = [x + disc.offset * math.cos(heading), y + disc.offset * math.sin(heading), z]
            alone = dataclasses.replace(
                space, discs=(), collision_distance_sq=disc.collision_distance_sq
            )
            if not alone.is_free(np.array(centre)):
                return False
    return True


def test_sweeps_are_free_only_where_every_pose_is():
    rng = np.random.default_rng(3)
    space = body_space(rng.random((60, 60, 1)) < 0.004)
    space = dataclasses.replace(space, cost_by_distance=np.zeros(201))
    verdicts = []
    for a, b in random_poses(space, 120, 5).reshape(60, 2, 4):
        b[:3] = a[:3] + 0.15 * (b[:3] - a[:3])
        free = space.sweep_free(a, b)
        if free:
            assert naive_free(space, a, b)
            length, turn = math.dist(a[:3], b[:3]), abs(angles.wrap(b[3] - a[3]))
            assert space.free_sweep_length(np.array([a, b])) == pytest.approx(length)
            cost = space.sweep_cost(np.array([a, b]))
            price = sweep_cost.TURN_COST * turn
            assert length + price <= cost <= (1 + 2 * sweep_cost.SIDEWAYS) * length + price + 1e-9
        else:
            assert space.sweep_cost(np.array([a, b])) == math.inf
        verdicts.append(free)
    assert 5 < sum(verdicts) < 55


def test_compiled_pose_kernels_equal_python():
    space = body_space(np.random.default_rng(3).random((60, 60, 1)) < 0.003)
    for a, b in random_poses(space, 40, 6).reshape(20, 2, 4):
        pair = (space.grid, space.shape, 2.0, tuple(a.tolist()), tuple(b.tolist()))
        assert sweep_cost.sweep_cost.py_func(*pair) == sweep_cost.sweep_cost(*pair)
    start, goal = point(space, 8.5, 8.5), point(space, 50.5, 50.5)
    settings = PlannerConfig("rrtconnect", restarts=1, shortcuts=0)
    found = plan(space, start, goal, settings, seed=2)
    poses = np.column_stack((found.waypoints, found.headings))
    draws = np.random.default_rng(0).uniform(0.0, 1.0, (20, 5)) * [1, 1, 1, 1, 0]
    short = pose_shortcut.shortcut_poses(space.grid, space.shape, 2.0, poses, draws)
    python = pose_shortcut.shortcut_poses.py_func(space.grid, space.shape, 2.0, poses, draws)
    assert python.tobytes() == short.tobytes()
    assert space.sweep_cost(short) < space.sweep_cost(poses)
    assert np.array_equal(short[[0, -1]], poses[[0, -1]])


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


def test_a_blocked_heading_is_told(gap):
    beside = point(gap, 32.5, 10.5)  # 0.3 m from the wall: along it is free, across is not
    goal = point(gap, 10.5, 30.5)
    assert plan(gap, beside, goal, PlannerConfig(), 1, heading=0.0).label == "start_blocked"
    assert plan(gap, beside, goal, PlannerConfig(), 1, heading=math.pi / 2).label == "none"
    assert plan(gap, goal, beside, PlannerConfig(), 1, goal_heading=0.0).label == "goal_blocked"
    to_wall = plan(gap, goal, beside, PlannerConfig(), 1)
    assert abs(math.sin(to_wall.headings[-1])) > 0.5


@pytest.mark.parametrize("curve", ["reeds_shepp", "dubins"])
def test_curves_keep_the_turning_radius(curve):
    space = body_space(np.zeros((80, 60, 1), dtype=bool))
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
    space = body_space(blocked)
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


def test_replanning_a_body_equals_planning_it_anew(gap):
    goal = point(gap, 65.5, 30.5)
    kept = GoalField(goal, PlannerConfig())
    for step in range(6):
        start = point(gap, 10.5 + step, 20.5)
        again = kept.plan(gap, start, seed=step + 1, heading=0.3)
        fresh = GoalField(goal, PlannerConfig()).plan(gap, start, seed=step + 1, heading=0.3)
        assert again.waypoints.tobytes() == fresh.waypoints.tobytes()
        assert again.headings.tobytes() == fresh.headings.tobytes()
