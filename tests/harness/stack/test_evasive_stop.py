"""Braking turns away from what has come into the way, and only then."""

import numpy as np
import pytest

from tests.harness.stack.make_input import make_input
from wayproof.harness.stack.gaits import Flight, TurnThenGo
from wayproof.harness.stack.manoeuvres.stopping import EMERGENCY, clearest_stop
from wayproof.planners import (
    FreeSpace,
    MotionLimits,
    PathState,
    arc_lengths,
    hold,
    stop_along,
)

LIMITS = MotionLimits(2.0, 2.5, 12.0, 2.5, 1.5)
AHEAD = np.array([[1.0, 3.0, 1.0], [2.0, 3.0, 1.0]])
CELL, REACH = 0.1, 10  # m; maximum distance of the field, cells


def space(*blocked):
    """6 x 6 x 2 m, cells (i, j, k) blocked, a body of 0.3 m."""
    shape = (60, 60, 20)
    cells = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1)
    field = np.full(shape, REACH**2)
    for cell in blocked:
        field = np.minimum(field, np.square(cells - cell).sum(axis=-1))
    return FreeSpace(field.astype(np.uint16), np.zeros(3), CELL, 9, np.ones(REACH**2 + 1))


def stop(free_space, speed=2.0, ground=False, path=AHEAD, start=None):
    now = start or hold(path[0], 0, 0.0).at(0)._replace(speed=speed)
    gait = (TurnThenGo if ground else Flight)(LIMITS, ((0.0, 0.3),))
    input = make_input(
        gait=gait, traversable=free_space, known_free=free_space, optimistic=free_space
    )
    return clearest_stop(input, now, path)


def test_a_free_way_is_kept():
    assert stop(space()) is AHEAD
    assert stop(space((20, 40, 10))) is AHEAD  # a metre aside


@pytest.mark.parametrize(("row", "sign"), [(31, -1.0), (27, 1.0)])
def test_it_turns_to_the_side_where_nothing_stands(row, sign):
    path = stop(space(*((20, row, k) for k in range(20))), ground=True)
    np.testing.assert_allclose(path[0], AHEAD[0])
    assert sign * (path[-1, 1] - 3.0) > 0.2
    np.testing.assert_allclose(path[:, 2], 1.0)
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    # 2 m/s, 2.5 m/s^2 and 12 m/s^3: (v / 2) (v / a + a / j) = 1.008 m
    assert steps.sum() == pytest.approx(1.008, abs=0.01)
    headings = np.arctan2(*np.diff(path, axis=0).T[1::-1])
    assert abs(headings[-1] - headings[0]) <= 0.5 * np.pi
    # As tight as full speed lets it be at first: v^2 / a = 1.6 m.
    assert abs(headings[1] - headings[0]) / steps[0] == pytest.approx(1 / 1.6, rel=0.1)


def test_a_bend_is_no_tighter_than_the_speed_left_on_it_allows():
    now = hold(AHEAD[0], 0, 0.0).at(0)._replace(speed=1.3, acceleration=2.5)
    pillars = [(15, 31, k) for k in range(20)]
    path = stop(space(*pillars), start=now)
    assert path is not AHEAD
    trajectory = stop_along(path, PathState(0, 0.0, 1.3, 2.5, 0.0), LIMITS)
    times = np.linspace(0.0, trajectory.duration_s, 50)
    samples = [trajectory.at(round(time * 1e9)) for time in times]
    headings = np.arctan2(*np.diff(path, axis=0).T[1::-1])
    middles = arc_lengths(path)[1:-1]
    curvature = np.abs(np.diff(headings)) / np.diff(arc_lengths(path))[1:]
    speeds = np.interp(middles, [one.arc_length for one in samples], [one.speed for one in samples])
    assert max(one.speed for one in samples) > 1.5
    lateral = float((speeds**2 * curvature).max())
    assert lateral <= 1.02 * EMERGENCY * LIMITS.lateral_acceleration


def test_what_flies_turns_up_and_down_too():
    bar = [(20, j, 8) for j in range(60)]  # across the way, a little below
    assert stop(space(*bar))[-1, 2] > 1.2
    np.testing.assert_allclose(stop(space(*bar), ground=True)[:, 2], 1.0)


def travelled(path, speed):
    """The path of the stop along a path, to where it ends at rest."""
    return stop_along(path, PathState(0, 0.0, speed, 0.0, 0.0), LIMITS).path


def test_a_bend_comes_no_nearer_than_the_path_does_until_the_robot_is_at_rest():
    generator, bends = np.random.default_rng(0), 0
    for n in range(120):
        speed = (0.4, 0.6, 2.0)[n % 3]
        around = space(*generator.integers((10, 24, 8), (24, 36, 13), (3, 3)))
        path = stop(around, speed)
        bends += path is not AHEAD
        straight = around.least_clearance(travelled(AHEAD, speed))
        assert around.least_clearance(travelled(path, speed)) >= straight
    assert bends > 20
