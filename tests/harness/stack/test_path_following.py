"""Following the global path, one manoeuvre at a time, and leaving it early for a new one."""

from dataclasses import replace

import numpy as np
import pytest

from tests.harness.stack.make_input import (
    GOAL,
    LIMITS,
    LONG,
    SIDLES,
    START,
    TURNS,
    at_rest,
    changed,
    course_of,
    drive,
    final_sample,
    make_gait,
    make_input,
    make_states,
    next_input,
    place,
    top_speed,
    with_spaces,
)
from wayproof.harness.stack.decide import decide
from wayproof.harness.stack.footprint_checks import first_misfit
from wayproof.harness.stack.gaits import AnyDirection, Flight
from wayproof.harness.stack.global_path import keep_or_replan
from wayproof.harness.stack.manoeuvres.driving import fit_trajectory
from wayproof.harness.stack.manoeuvres.following import brake_on_path, follow, keep_course
from wayproof.harness.stack.manoeuvres.setting_out import set_out, step_aside, turn_to
from wayproof.harness.stack.path_timing import fastest_found, plan_trajectory
from wayproof.harness.stack.situation import DrivablePart, drivable_part
from wayproof.harness.stack.types import BehaviourConfig, arc_length, is_free_along
from wayproof.planners import PathState, follow_path, stopping_distance

PATH = np.array([place(*START), place(*GOAL)])
FULL_STOP = stopping_distance(LIMITS.speed, 0.0, LIMITS)
LANE = make_states(occupied=[(0.0, 8.0, 0.0, 1.7), (0.0, 8.0, 2.4, 4.0)])
"""A lane of 0.7 m along x, in which the long body cannot turn."""


@pytest.mark.parametrize(
    ("unknown_from", "action"), [(2.2, "slow"), (round(1.8 + FULL_STOP, 1), "follow")]
)
def test_a_path_is_driven_up_to_the_unknown_slowly_if_full_speed_could_not_stop(
    unknown_from, action
):
    input = make_input(make_states(unknown=[(unknown_from, 8.0, 0.0, 4.0)]))
    command, _ = decide(input, at_rest(global_path=PATH))
    assert (command.action, command.label) == (action, "unknown_ahead")
    assert command.trajectory.path[-1, 0] == pytest.approx(
        START[0] + command.reason.free_m, abs=1e-5
    )
    assert command.trajectory.path[-1, 0] < unknown_from - 0.3
    assert command.reason.cell[0] == pytest.approx(unknown_from, abs=0.1)


@pytest.mark.parametrize(("angle", "turns"), [(0.5, False), (0.7, True)])
def test_a_ground_robot_turns_in_place_beyond_its_angle(angle, turns):
    assert BehaviourConfig().rotate_in_place_angle == 0.6
    input = make_input(gait=TURNS, heading=angle)
    command, _ = decide(input, at_rest(heading=angle, global_path=PATH))
    assert (command.reason.kind == "turning") is turns
    moved = final_sample(command.trajectory).position[0] - START[0]
    assert (moved < 1e-9) == turns
    if turns:
        assert command.reason.turn_rad == pytest.approx(0.0, abs=1e-6)  # the path's heading


def test_braking_before_the_end_of_a_free_path_has_no_label():
    state = drive(8)
    input = next_input(state, 8)
    start = state.trajectory.at(input.effect_ns)
    path = start.position + np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0]])
    state = changed(state, global_path=path)
    command, _ = brake_on_path(
        course_of(input, state, part=DrivablePart(0.2, blocked=False, too_short=True))
    )
    assert (command.action, command.label) == ("stop_and_wait", "none")
    assert command.reason.kind == "braking_for_goal"
    assert command.reason.path_m == pytest.approx(arc_length(command.trajectory.path), abs=1e-6)


def test_a_turn_that_leads_to_the_heading_already_goes_on():
    input = make_input(gait=TURNS, sequence=0)
    state = at_rest(heading=0.0, global_path=PATH)
    command, state = turn_to(course_of(input, state), 1.5)
    state = changed(state, committed=(command.trajectory,))
    later = make_input(gait=TURNS, sequence=3)
    start = state.trajectory.at(later.effect_ns)
    assert not start.at_rest
    again, _ = turn_to(course_of(later, state), 1.55)
    assert again.trajectory is command.trajectory
    other, _ = turn_to(course_of(later, state), 1.8)
    assert other.trajectory is not command.trajectory


def test_a_turn_into_the_path_is_no_drive_that_ends_at_its_heading():
    input = make_input(LANE, LONG, gait=SIDLES)
    creeping = plan_trajectory(input, at_rest().trajectory.at(input.effect_ns), PATH, 1.0)
    state = changed(at_rest(global_path=PATH), committed=(creeping,))
    moving = creeping.at(input.effect_ns)._replace(at_rest=False)
    command, _ = turn_to(course_of(input, state)._replace(start=moving), target=0.1)
    assert final_sample(command.trajectory).heading == pytest.approx(0.1, abs=1e-3)
    assert np.ptp(command.trajectory.path, axis=0).max() == 0.0


@pytest.mark.parametrize(("heading", "tail_first"), [(0.0, False), (np.pi, True)])
def test_a_long_body_in_a_lane_sets_out_as_it_lies(heading, tail_first):
    input = make_input(LANE, LONG, heading=heading)
    state = at_rest(heading=heading, global_path=PATH)
    command, _ = set_out(course_of(input, state, part=DrivablePart(5.5, blocked=False)))
    assert command.action == "follow"
    poses = command.trajectory.poses(0.1)
    assert poses[-1, 0] > 3.0
    off = np.abs((poses[:, 3] - heading + np.pi) % (2 * np.pi) - np.pi)
    assert off.max() < 1e-6  # it does not turn about
    share = BehaviourConfig().reverse_speed_fraction if tail_first else 1.0
    assert top_speed(command.trajectory) <= share * LIMITS.speed + 1e-6


def test_a_long_body_with_no_room_to_turn_into_its_path_waits_and_drops_it():
    input = make_input(LANE, LONG, heading=0.0, position=(3.05, 2.05))
    across = np.array([place(3.05, 2.05), place(3.05, 3.55)])
    state = at_rest((3.05, 2.05), global_path=across)
    part = DrivablePart(0.4, blocked=True)
    command, after = set_out(course_of(input, state, part=part))
    assert (command.action, command.label) == ("stop_and_wait", "no_path")
    assert command.reason.kind == "waiting"
    assert command.reason.cell_state == "occupied"
    assert after.global_path is None


def test_a_long_body_drives_its_last_path_as_far_as_it_fits_before_it_brakes():
    state = drive(8, body=LONG)
    walled = next_input(state, 8, body=LONG, states=make_states(occupied=[(4.0, 4.3, 0.0, 4.0)]))
    command, _ = keep_course(course_of(walled, state))
    assert (command.action, command.label) == ("follow", "path_blocked")
    assert command.trajectory.stop_point[0] < 4.0 - 0.3
    assert first_misfit(walled.traversable, command.trajectory) is None
    near = next_input(state, 8, body=LONG, states=make_states(occupied=[(2.0, 2.3, 0.0, 4.0)]))
    command, after = keep_course(course_of(near, state))
    assert (command.action, command.label) == ("stop_and_wait", "path_blocked")
    assert command.reason.cell[0] == pytest.approx(2.05)
    assert after.global_path is None


def test_a_trajectory_is_shortened_to_where_a_long_body_fits():
    states = make_states(occupied=[(3.0, 3.2, 0.0, 4.0)])
    input = make_input(states, LONG)
    start = at_rest().trajectory.at(input.effect_ns)
    fitted = fit_trajectory(input, start, PATH, 1.0, tail_first=False)
    end = fitted.poses(0.01)[-1, 0]
    assert 2.2 < end < 3.0 - 0.5  # its nose is 0.5 m ahead of its centre
    assert input.traversable.free_poses(fitted.poses(0.01)) == len(fitted.poses(0.01))
    ahead = np.array([place(*START), place(1.15, 2.05)])
    assert fit_trajectory(make_input(make_states(occupied=[(1.6, 1.8, 0.0, 4.0)]), LONG), start,
                          ahead, 1.0, tail_first=False) is None  # fmt: skip


def test_a_long_body_steps_aside_at_its_heading_where_it_has_no_room_at_that_of_its_path():
    """Across a lane that is as wide as the body is long: it cannot turn into the way along it."""
    lane = make_states(occupied=[(0.0, 8.0, 0.0, 1.4), (0.0, 8.0, 2.7, 4.0)])
    input = make_input(lane, LONG, heading=np.pi / 2, gait=SIDLES)
    assert input.traversable.pose_free(input.position, np.pi / 2)
    state = at_rest(heading=np.pi / 2, global_path=np.array([place(*START), place(*GOAL)]))
    part = DrivablePart(0.0, blocked=True)
    stepped = step_aside(course_of(input, state, part=part))
    end = final_sample(stepped.command.trajectory)
    assert end.heading == np.pi / 2
    assert end.position[0] - START[0] == pytest.approx(0.5, abs=0.05)
    assert first_misfit(input.traversable, stepped.command.trajectory) is None


def test_a_long_body_keeps_an_admitted_trajectory_where_its_path_has_closed():
    room = {"body": LONG, "states": make_states(occupied=[(0.0, 8.0, 2.9, 4.0)])}
    state = drive(8, **room)
    input = next_input(state, 8, **room)
    start = state.trajectory.at(input.effect_ns)
    bend = start.position + np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 1.5, 0.0]])
    closed = changed(state, global_path=bend, improved_ns=123)
    command, after = follow(input, closed, start, previous=state)
    assert command.reason.kind == "following"
    assert command.trajectory is state.trajectory
    assert (after.route.improved_ns, after.global_path is state.global_path) == (123, True)
    room["states"] = make_states(occupied=[(0.0, 8.0, 2.9, 4.0), (4.0, 4.3, 0.0, 4.0)])
    command, _ = follow(next_input(state, 8, **room), closed, start, previous=state)
    assert command.reason.kind == "braking_for_blocked"


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
