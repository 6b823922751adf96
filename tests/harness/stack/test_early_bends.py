"""Early bends: where a body that need not face along its path leaves it for a new one."""

from dataclasses import replace

import numpy as np
import pytest

from tests.harness.stack.make_input import (
    LIMITS,
    PERIOD_NS,
    START,
    at_rest,
    drive,
    make_gait,
    make_input,
    make_states,
    next_input,
    place,
    with_spaces,
)
from wayproof.harness.stack.gaits import AnyDirection, Flight
from wayproof.harness.stack.global_path import keep_or_replan
from wayproof.harness.stack.path_timing import fastest_found
from wayproof.harness.stack.situation import drivable_part
from wayproof.harness.stack.types import arc_length, is_free_along
from wayproof.planners import PathState, follow_path, stopping_distance

FLIES = {"gait": make_gait(Flight, sideways_speed=LIMITS.speed)}
BLOCK = (4.0, 4.3, 0.0, 2.4)
"""What comes to light on the straight line, with room beside it."""


def in_motion(**moves):
    """A robot at 2 m/s whose straight path is found blocked: its input, state and start."""
    state = drive(9, **moves)
    input = next_input(state, 9, states=make_states(occupied=[BLOCK]), **moves)
    return input, state, state.trajectory.at(input.effect_ns)


def leaves_after(path):
    """Length of a path (n, 3) before it leaves the straight line, m."""
    off = np.abs(path[:, 1] - START[1]) > 0.01
    return path[np.argmax(off), 0] - path[0, 0]


def test_a_path_is_left_within_the_distance_of_a_stop_and_still_ends_at_rest_in_free_space():
    input, state, start = in_motion(**FLIES)
    braking = stopping_distance(start.speed, start.acceleration, input.gait.limits)
    path = keep_or_replan(input, state, start).state.global_path
    assert leaves_after(path) < 0.7 * braking
    assert is_free_along(input.traversable, path)
    motion = PathState(0, 0.0, start.speed, start.acceleration, start.heading)
    assert follow_path(path, motion, input.gait.limits, 9.0).overshoot_m == 0.0
    facing, state, start = in_motion()
    assert leaves_after(keep_or_replan(facing, state, start).state.global_path) > braking


@pytest.mark.parametrize(
    ("kind", "sideways", "early"),
    [(Flight, 2.0, True), (Flight, 0.0, False), (AnyDirection, 2.0, False)],
)
def test_only_a_body_that_flies_in_any_direction_bends_early(kind, sideways, early):
    limits = replace(LIMITS, speed=4.0, lateral_acceleration=4.0)
    gait = make_gait(kind, limits=limits, sideways_speed=sideways)
    assert bool(gait.early_bends) is early
    assert gait.replan_period == pytest.approx(0.3 if early else 1.0)
    assert gait.blend_length(0.6) == pytest.approx(1.2 if early else 0.6)


def test_a_path_is_searched_anew_after_the_shorter_period():
    straight = np.array([place(*START), place(6.55, 2.05)])
    state = at_rest(global_path=straight)
    gait = make_gait(Flight, limits=replace(LIMITS, speed=4.0), sideways_speed=2.0)
    for sequence, searched in ((2, False), (3, True)):
        input = make_input(sequence=sequence, gait=gait)
        planned = keep_or_replan(input, state, state.trajectory.at(input.effect_ns))
        assert (planned.search is not None) is searched
        assert planned.state.route.improved_ns == (sequence * PERIOD_NS if searched else 0)


BENT = np.array([place(1.05, 2.05), place(3.05, 2.05), place(3.05, 3.55)])


@pytest.mark.parametrize(("moves", "length"), [({}, 2.0), (FLIES, 3.5)])
def test_a_corner_that_cannot_be_rounded_is_flown_slowly_and_not_stopped_at(moves, length):
    input = make_input(goal=(3.05, 3.55), **moves)
    state = at_rest(global_path=BENT)
    part = drivable_part(input, BENT, state.trajectory.at(input.effect_ns))
    assert part.length == pytest.approx(length)


def ahead(start, *offsets):
    """A path (n, 3) from the start through places beside it, (x, y) m."""
    return np.array([start.position + np.array([x, y, 0.0]) for x, y in ((0.0, 0.0), *offsets)])


def chosen(input, start, braking, paths):
    """The choice among paths (n, 3), by the share of the way to a stop after which they leave."""
    prefix = ahead(start, (braking, 0.0))
    return fastest_found(
        input, start, prefix, lambda kept: (None, paths[round(arc_length(kept) / braking, 2)])
    )[1]


def test_the_fastest_path_is_taken_of_those_along_which_the_limits_are_kept():
    input, _, start = in_motion(**FLIES)
    braking = stopping_distance(start.speed, start.acceleration, input.gait.limits)
    long, short = ahead(start, (3.0, 0.0), (3.0, 1.0)), ahead(start, (3.0, 0.0))
    kink = ahead(start, (0.1, 0.0), (0.1, 0.05), (0.1, 1.5))
    free = with_spaces(input, traversable=make_input().traversable)
    assert chosen(free, start, braking, {1.0: long, 0.5: short, 0.05: kink}) is short
    assert chosen(free, start, braking, {1.0: short, 0.5: long, 0.05: kink}) is short
    assert chosen(free, start, braking, {1.0: None, 0.5: long, 0.05: None}) is long
    assert chosen(free, start, braking, {1.0: None, 0.5: None, 0.05: kink}) is None


def test_no_path_is_taken_early_that_is_not_admitted_as_far_as_a_stop_takes():
    input, _, start = in_motion(**FLIES)
    braking = stopping_distance(start.speed, start.acceleration, input.gait.limits)
    x = round(float(start.position[0]) + 0.5 * braking, 1)
    near = make_input(make_states(unknown=[(x, 8.0, 0.0, 4.0)])).traversable
    late, early = ahead(start, (3.0, 0.0), (3.0, 1.0)), ahead(start, (3.0, 0.0))
    assert chosen(input, start, braking, {1.0: late, 0.5: None, 0.05: early}) is early
    unknown = with_spaces(input, traversable=near)
    assert chosen(unknown, start, braking, {1.0: late, 0.5: None, 0.05: early}) is late
