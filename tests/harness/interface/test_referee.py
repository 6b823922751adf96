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


def seen(x, age_s):
    """Times of places at 10 s: those from x on were last seen some time ago, the others now."""
    return lambda places: (1e9 * (10.0 - age_s * (places[:, 0] >= x))).astype(np.int64)


def never(places):
    return np.full(len(places), -1)


FAST = Velocity(2.0, duration_s=1.0)
"""Leads to about 2.3 m, and comes to rest 0.8 m farther."""

BESIDE = {"position": (3.75, 2.05), "occupied": [WALL]}

SIDES = [(3.0, 4.0, 0.0, 1.7), (3.0, 4.0, 2.5, 4.0)]
GAP = {"position": (1.05, 2.1), "body": LONG, "occupied": SIDES}
"""Of 0.8 m along x: the body, 1 m long and 0.4 m wide, fits only along it."""

TURN = turn_in_place(place(1.05, 2.05), PERIOD_NS, 0.0, np.pi / 2, LIMITS)


def stop_dead(x):
    """Samples that stop dead at x from 1 m/s, which takes 0.2 m, 0.1 m before, and their room."""
    points = np.stack([place(x - 0.1, 2.05), place(x, 2.05)])
    room = {"speed": 1.0, "position": (x - 0.1, 2.05), "occupied": [WALL]}
    return Samples(0.1, points, np.zeros(2)), room


@pytest.mark.parametrize(
    ("motion", "room", "expected"),
    [
        (to(3.05), {"occupied": [WALL]}, "admitted"),
        (to(6.05), {"occupied": [WALL]}, "blocked"),
        (to(6.05), {"unknown": [FOG]}, "unknown"),
        (to(6.05), {"unknown": [FOG], "policy": "penalize"}, "admitted"),
        (to(6.05), {"unknown": [FOG], "policy": "allow", "occupied": [WALL]}, "blocked"),
        (to(7.05), {"unknown": [FOG], "occupied": [(5.5, 5.7, 0.0, 4.0)]}, "blocked"),  # behind it
        (to(9.05), {}, "blocked"),  # outside of the operating area
        (to(6.05), {"observed": seen(4.0, 0.6)}, "stale"),
        (to(6.05), {"observed": seen(4.0, 0.5)}, "admitted"),
        (to(3.05), {"observed": seen(4.0, 0.6)}, "admitted"),
        (Velocity(0.0), {"observed": seen(0.0, 60.0)}, "admitted"),
        (to(6.05), {"observed": seen(0.0, 60.0), "occupied": [WALL]}, "blocked"),
        (to(6.05), {"observed": seen(0.0, 60.0), "unknown": [FOG]}, "unknown"),
        (to(6.05), {"observed": never}, "admitted"),
        (to(3.58), {"occupied": [WALL]}, "admitted"),
        (*stop_dead(3.2), "admitted"),
        (*stop_dead(3.58), "blocked"),  # the body rolls on
        (FAST, {"occupied": [(3.0, 3.2, 0.0, 4.0)]}, "blocked"),
        (FAST, {"occupied": [(4.6, 4.8, 0.0, 4.0)]}, "admitted"),
        (hold(place(3.75, 2.05), PERIOD_NS, 0.0), BESIDE, "admitted"),
        (Velocity(0.0), BESIDE, "admitted"),
        (Velocity(0.004, duration_s=0.1), BESIDE, "blocked"),  # it creeps
        (to(6.05, 2.1), GAP, "admitted"),
        (Velocity(0.0, -1.5, duration_s=2.5), {**GAP, "heading": np.pi / 2}, "blocked"),  # along x
        (TURN, {"body": LONG, "occupied": [(0.0, 8.0, 2.45, 4.0)]}, "blocked"),
        (TURN, {"body": ROUND, "occupied": [(0.0, 8.0, 2.45, 4.0)]}, "admitted"),
    ],
)
def test_a_motion_has_its_verdict(motion, room, expected):
    assert verdict(motion, **room).verdict == expected


def test_a_verdict_says_how_far_the_way_is_free_and_what_ends_it():
    """The wall's face is at 4 m: a disc of 0.3 m and half a cell's diagonal comes to 3.6 m."""
    free = verdict(to(3.05), occupied=[WALL]).overlap
    assert (free.free_m, free.cell) == (pytest.approx(2.0, abs=1e-6), None)
    blocked = verdict(to(6.05), occupied=[WALL]).overlap
    assert blocked.free_m == pytest.approx(2.55, abs=0.15)
    assert (blocked.cell_state, blocked.cell[0]) == ("occupied", pytest.approx(4.05))
    hidden = verdict(to(7.05), unknown=[FOG], occupied=[(5.5, 5.7, 0.0, 4.0)])
    assert hidden.overlap.cell_state == "unknown"  # comes first on the way
    stale = verdict(to(6.05), observed=seen(4.0, 0.6))
    assert stale.overlap.free_m == pytest.approx(4.0 + 0.3 - 1.05, abs=0.26)
    assert stale.old.age_s == pytest.approx(0.6)


def test_what_is_free_along_its_path_is_admitted_whichever_corners_of_cells_it_passes():
    """Straight ways between centres of cells, many through the corner of a cell."""
    generator = np.random.default_rng(1)
    admitted = 0
    for _ in range(15):
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
    assert 375 < admitted < 860  # both are common


def test_a_body_that_is_under_way_is_judged_from_where_it_is():
    path = np.stack((place(1.05, 2.05), place(6.05, 2.05)))
    motion = follow_path(path, PathState(0, 0.0, 0.0, 0.0, 0.0), LIMITS, 1.0)
    behind = make_states(occupied=[(1.0, 1.2, 2.0, 2.2)])
    for passed_ns, expected in ((0, "blocked"), (1_500_000_000, "admitted")):
        input = make_input(behind, effect_ns=passed_ns)
        assert judge(motion, input, input).verdict == expected
