import dataclasses
import math

import numpy as np
import pytest

from tests.planners.worlds import LONG, long_space, make_space, point
from wayproof.maps import collision_distance_sq
from wayproof.planners import (
    STATE_SPACES,
    Body,
    Disc,
    PlannerConfig,
    plan,
    state_space_for,
)
from wayproof.planners.kernels import angles


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
