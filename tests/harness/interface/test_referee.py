"""The referee's verdict on hand-made trajectories in a hand-made room."""

import numpy as np
import pytest

from tests.harness.stack.make_input import (
    LIMITS,
    LONG,
    PERIOD_NS,
    ROUND,
    make_input,
    make_states,
    place,
)
from wayproof.harness.interface.motion import trajectory_of
from wayproof.harness.interface.referee import judge
from wayproof.harness.interface.types import Reference, Samples, Velocity, Waypoints
from wayproof.harness.stack.types import arc_length
from wayproof.planners import PathState, follow_path, hold, turn_in_place

WALL, FOG = (4.0, 4.2, 0.0, 4.0), (4.0, 5.0, 0.0, 4.0)


def verdict(
    motion,
    body=ROUND,
    policy="forbid",
    heading=0.0,
    position=(1.05, 2.05),
    speed=0.0,
    observed=None,
    **rectangles,
):
    states = make_states(**rectangles)
    circumscribed = make_input(states, ROUND if body is ROUND else wide(), policy, position)
    seen = {} if observed is None else {"observed_ns": observed, "time_ns": 10**10}
    oriented = make_input(states, body, policy, position, **seen)
    velocity = np.array([speed, 0.0, 0.0])
    reference = Reference(place(*position), velocity, heading, 0.0, at_rest=speed == 0.0)
    if isinstance(motion, Velocity | Waypoints | Samples):
        motion = trajectory_of(motion, (reference, reference), PERIOD_NS, LIMITS, planar=True)
        motion = motion.trajectory
    return judge(motion, circumscribed, oriented)


def wide():
    """The disc about the long body."""
    return type(LONG)((0.0,), (0.5,))


def to(x, y=2.05):
    return Waypoints(place(x, y)[None])


def test_free_space_to_the_rest_is_admitted_with_its_length():
    found = verdict(to(3.05), occupied=[WALL])
    assert found.verdict == "admitted"
    assert found.overlap.free_m == pytest.approx(2.0, abs=1e-6)
    assert found.overlap.cell is None


def seen(x, age_s):
    """Times of places at 10 s: those from x on were last seen some time ago, the others now."""
    return lambda places: (1e9 * (10.0 - age_s * (places[:, 0] >= x))).astype(np.int64)


def test_what_was_last_seen_long_ago_is_stale_up_to_where_the_body_comes_to_it():
    found = verdict(to(6.05), observed=seen(4.0, 0.6))
    assert found.verdict == "stale"
    assert found.overlap.free_m == pytest.approx(4.0 + 0.3 - 1.05, abs=0.26)
    assert found.old.age_s == pytest.approx(0.6)
    assert verdict(to(6.05), observed=seen(4.0, 0.5)).verdict == "admitted"
    assert verdict(to(3.05), observed=seen(4.0, 0.6)).verdict == "admitted"
    assert verdict(Velocity(0.0), observed=seen(0.0, 60.0)).verdict == "admitted"


def test_what_is_blocked_or_unknown_is_so_whenever_it_was_seen():
    old = seen(0.0, 60.0)
    assert verdict(to(6.05), occupied=[WALL], observed=old).verdict == "blocked"
    assert verdict(to(6.05), unknown=[FOG], observed=old).verdict == "unknown"
    never = verdict(to(6.05), observed=lambda places: np.full(len(places), -1))
    assert never.verdict == "admitted"


def test_an_obstacle_blocks_where_the_body_would_overlap_it():
    """Its face is at 4 m: a disc of 0.3 m and half a cell's diagonal comes to about 3.6 m."""
    found = verdict(to(6.05), occupied=[WALL])
    assert found.verdict == "blocked"
    assert found.overlap.free_m == pytest.approx(2.55, abs=0.15)
    assert found.overlap.cell_state == "occupied"
    assert found.overlap.cell[0] == pytest.approx(4.05)


def test_the_unknown_is_unknown_unless_the_policy_lets_the_body_enter_it():
    assert verdict(to(6.05), unknown=[FOG]).verdict == "unknown"
    assert verdict(to(6.05), unknown=[FOG]).overlap.cell_state == "unknown"
    assert verdict(to(6.05), policy="penalize", unknown=[FOG]).verdict == "admitted"
    assert verdict(to(6.05), policy="allow", unknown=[FOG], occupied=[WALL]).verdict == "blocked"


def test_a_dead_stop_before_a_wall_is_blocked_where_the_body_rolls_on():
    """From 1 m/s the body takes 0.2 m, which is asked to stop dead at a place that is free."""
    assert verdict(to(3.58), occupied=[WALL]).verdict == "admitted"
    for stop, expected in ((3.2, "admitted"), (3.58, "blocked")):
        points = np.stack([place(stop - 0.1, 2.05), place(stop, 2.05)])
        dead = Samples(0.1, points, np.zeros(2))
        start = (stop - 0.1, 2.05)
        assert verdict(dead, speed=1.0, position=start, occupied=[WALL]).verdict == expected


def test_an_obstacle_behind_the_unknown_blocks():
    hidden = verdict(to(7.05), unknown=[FOG], occupied=[(5.5, 5.7, 0.0, 4.0)])
    assert hidden.verdict == "blocked"
    assert hidden.overlap.cell_state == "unknown"  # comes first on the way


def test_what_lies_outside_of_the_operating_area_blocks():
    assert verdict(to(9.05)).verdict == "blocked"


def test_the_braking_counts():
    """2 m/s for 1 s leads to about 2.3 m and comes to rest 0.8 m farther: the wall is in it."""
    fast = Velocity(2.0, duration_s=1.0)
    assert verdict(fast, occupied=[(3.0, 3.2, 0.0, 4.0)]).verdict == "blocked"
    assert verdict(fast, occupied=[(4.6, 4.8, 0.0, 4.0)]).verdict == "admitted"


def test_a_body_that_stays_is_admitted_wherever_it_is_and_one_that_creeps_is_not():
    beside = {"position": (3.75, 2.05), "occupied": [WALL]}
    assert verdict(hold(place(3.75, 2.05), PERIOD_NS, 0.0), **beside).verdict == "admitted"
    assert verdict(Velocity(0.0), **beside).verdict == "admitted"
    assert verdict(Velocity(0.004, duration_s=0.1), **beside).verdict == "blocked"


def test_an_elongated_body_is_judged_at_its_heading():
    """A gap of 0.8 m along x: the body, 1 m long and 0.4 m wide, fits only along it."""
    gap = {"occupied": [(3.0, 4.0, 0.0, 1.7), (3.0, 4.0, 2.5, 4.0)]}
    assert verdict(to(6.05, 2.1), LONG, position=(1.05, 2.1), **gap).verdict == "admitted"
    sideways = Velocity(0.0, -1.5, duration_s=2.5)  # to its right, which is along x
    across = verdict(sideways, LONG, heading=np.pi / 2, position=(1.05, 2.1), **gap)
    assert across.verdict == "blocked"


def test_a_turn_in_place_sweeps_an_elongated_body_alone():
    close = {"occupied": [(0.0, 8.0, 2.45, 4.0)]}
    turn = turn_in_place(place(1.05, 2.05), PERIOD_NS, 0.0, np.pi / 2, LIMITS)
    assert verdict(turn, LONG, **close).verdict == "blocked"
    assert verdict(turn, ROUND, **close).verdict == "admitted"


def test_what_is_free_along_its_path_is_admitted_whichever_corners_of_cells_it_passes():
    """Straight ways between centres of cells, many through the corner of a cell."""
    generator = np.random.default_rng(1)
    admitted = 0
    for _ in range(40):
        walls = [(x, x + 0.1, y, y + 0.1) for x, y in generator.integers(20, 40, (3, 2)) * 0.1]
        input = make_input(make_states(occupied=walls), position=(1.05, 2.05))
        for x, y in generator.integers(10, 30, (60, 2)) * 0.1 + 0.05:
            motion = follow_path(
                np.stack((place(1.05, 2.05), place(1.05 + x, y))),
                PathState(PERIOD_NS, 0.0, 0.0, 0.0, 0.0),
                LIMITS,
                1.0,
            )
            free = input.traversable.free_length(motion.path) >= arc_length(motion.path) - 1e-6
            assert (judge(motion, input, input).verdict == "admitted") == free
            admitted += free
    assert 1000 < admitted < 2300  # both are common


def test_a_body_that_is_under_way_is_judged_from_where_it_is():
    path = np.stack((place(1.05, 2.05), place(6.05, 2.05)))
    motion = follow_path(path, PathState(0, 0.0, 0.0, 0.0, 0.0), LIMITS, 1.0)
    behind = make_states(occupied=[(1.0, 1.2, 2.0, 2.2)])
    for passed_ns, expected in ((0, "blocked"), (1_500_000_000, "admitted")):
        input = make_input(behind, effect_ns=passed_ns)
        assert judge(motion, input, input).verdict == expected
