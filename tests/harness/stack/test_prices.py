"""What ways through unknown space and closed gaps cost, and how fast they are taken."""

from dataclasses import replace

import numpy as np
import pytest

from tests.harness.stack.make_input import (
    GOAL,
    LONG,
    START,
    TURNS,
    at_rest,
    changed,
    make_gait,
    make_input,
    make_space,
    make_states,
    place,
)
from wayproof.harness.config import Config
from wayproof.harness.input_messages import beams_from_info
from wayproof.harness.scenario.scenario import build, sensor_info
from wayproof.harness.stack.decide import decide
from wayproof.harness.stack.gait import is_omnidirectional
from wayproof.harness.stack.gaits import Flight
from wayproof.harness.stack.global_path import keep_or_replan
from wayproof.harness.stack.prices import (
    DETOUR,
    GIVEN_UP_NS,
    UNKNOWN,
    costly_gaps,
    enough_admitted,
    note_lost_way,
    record_closed_gap,
    with_closed_gaps,
    with_costs,
)
from wayproof.harness.stack.state import ClosedGap, LostWay
from wayproof.harness.stack.types import BehaviourConfig, arc_length
from wayproof.maps import FREE, OCCUPIED
from wayproof.planners import plan, stopping_distance

FAR = (4.0, 4.5, 1.0, 4.0)
"""Unknown space across the straight way, 3 m ahead; what is left beside it is known."""

NEAR = (1.9, 2.4, 1.0, 4.0)
"""The same, less than a stop from full speed ahead."""

UNKNOWN_COST = 4.0


def room_with(unknown, **others):
    """Input in a room with unknown space, where that is as dear as in a costmap."""
    states = make_states(unknown=[unknown])
    known, passable = make_space(states != FREE), make_space(states == OCCUPIED)
    prices = (known.distances <= known.collision_distance_sq) * np.uint8(UNKNOWN)
    optimistic = with_costs(replace(passable, prices=prices), {UNKNOWN: UNKNOWN_COST})
    return make_input(states, optimistic=optimistic, **others)


def lowest_of(input, **state):
    """Least y of the path that is planned, m: below 1 m it leads around the unknown space."""
    begin = at_rest(**state)
    planned = keep_or_replan(input, begin, begin.trajectory.at(input.effect_ns))
    return planned.state.global_path[:, 1].min()


AROUND = np.array([place(*START), place(1.05, 0.65), place(6.55, 0.65), place(*GOAL)])


@pytest.mark.parametrize(
    ("unknown", "room", "state", "through"),
    [
        (FAR, {}, {}, True),
        (NEAR, {}, {}, False),  # the robot would brake before it
        (FAR, {"gait": TURNS}, {}, False),  # what is on the ground pays in full
        (FAR, {"gait": make_gait(Flight, omnidirectional=False)}, {}, False),
        (FAR, {"sequence": 20}, {"global_path": AROUND}, True),
    ],
)
def test_a_robot_in_flight_goes_through_unknown_space_that_it_sees_in_time(
    unknown, room, state, through
):
    assert (lowest_of(room_with(unknown, **room), **state) > 1.0) == through


def test_enough_is_admitted_for_a_stop_from_full_speed_and_a_quarter():
    input = room_with(FAR)
    stop = stopping_distance(input.gait.limits.speed, 0.0, input.gait.limits)
    straight = np.array([place(*START), place(*GOAL)])
    free = input.traversable.free_length(straight)
    assert free > 1.25 * stop
    assert enough_admitted(input, straight)
    for left, enough in ((1.3 * stop, True), (1.2 * stop, False)):
        near = np.array([place(START[0] + free - left, START[1]), place(*GOAL)])
        assert enough_admitted(input, near) == enough
    short = np.array([place(*START), place(START[0] + 0.2, START[1])])
    assert enough_admitted(input, short)


def test_a_lidar_sees_all_around_and_a_camera_or_an_altimeter_does_not():
    casters = build(Config("empty", "drone", 0)).scene.casters
    sensors = {one.name: beams_from_info(one) for one in map(sensor_info, casters)}
    assert is_omnidirectional(sensors.values())
    assert is_omnidirectional([sensors["lidar"]])
    for seen in ([sensors["depth"]], [sensors["altimeter"]], []):
        assert not is_omnidirectional(seen)


SHARE = BehaviourConfig().unknown_speed_fraction


def decided(unknown_from, **behaviour):
    """Decision of a robot at rest before space that is unknown from some x on, m."""
    states = make_states(unknown=[(unknown_from, 8.0, 0.0, 4.0)])
    settings = BehaviourConfig(**behaviour)
    input = make_input(states, policy="penalize", behaviour=settings)
    return input, decide(input, at_rest())[0]


def speeds_of(trajectory, known):
    """Speeds up to a length of the way and beyond it, m/s, to the end of a trajectory."""
    times = trajectory.start_ns + np.arange(0.0, trajectory.duration_s, 0.002) * 1e9
    samples = [trajectory.at(int(time)) for time in times]
    before = [one.speed for one in samples if one.arc_length < known - 1e-6]
    return np.array(before), np.array([one.speed for one in samples if one.arc_length >= known])


@pytest.mark.parametrize(("unknown_from", "action"), [(4.0, "follow"), (2.2, "slow")])
def test_a_robot_slows_down_where_the_unknown_begins(unknown_from, action):
    input, command = decided(unknown_from)
    known = command.reason.free_m
    assert (command.action, command.reason.kind) == (action, "slowing_for_unknown")
    before, beyond = speeds_of(command.trajectory, known)
    assert beyond.max() == pytest.approx(SHARE * input.gait.limits.speed, rel=0.05)
    assert beyond.max() <= SHARE * input.gait.limits.speed + 1e-6
    assert command.trajectory.stop_point == pytest.approx(input.goal)
    if action == "follow":
        assert known > stopping_distance(input.gait.limits.speed, 0.0, input.gait.limits)
        assert before.max() == pytest.approx(input.gait.limits.speed)


def test_a_tiny_share_still_ends_at_the_goal_and_a_known_way_costs_no_speed():
    input, command = decided(4.0, unknown_speed_fraction=1e-6)
    _, beyond = speeds_of(command.trajectory, command.reason.free_m)
    assert beyond.max() == pytest.approx(0.02, rel=0.01)
    assert command.trajectory.stop_point == pytest.approx(input.goal)
    input, command = decided(7.9)
    assert (command.action, command.reason.kind) == ("follow", "following")
    assert speeds_of(command.trajectory, 1e9)[0].max() == pytest.approx(input.gait.limits.speed)


WALL = (3.0, 3.4)
TWO_GAPS = make_states(
    occupied=[(*WALL, 0.0, 0.5), (*WALL, 1.4, 2.6), (*WALL, 3.5, 4.0)]
)  # 0.9 m wide each, at y = 0.95 and 3.05
LOW, HIGH = (3.2, 0.95, 0.05), (3.2, 3.05, 0.05)
WAY = np.linspace(place(*START), place(*GOAL), 101)


def plan_in(space, input):
    return plan(space, input.position, input.goal, input.planner, 1, 0.0)


def side(found):
    """Which gap a way leads through: -1 the lower, 1 the upper one."""
    middle = found.waypoints[np.abs(found.waypoints[:, 0] - 3.2).argmin()]
    return int(np.sign(middle[1] - 2.0))


def test_a_way_leads_around_a_gap_that_closed_and_back_when_both_did():
    input = make_input(TWO_GAPS, LONG, position=(1.05, 1.5), goal=(6.55, 1.5))
    assert side(plan_in(input.optimistic, input)) == -1
    once = costly_gaps(input.optimistic, (ClosedGap(LOW, 1),), 2.0)
    assert side(plan_in(once, input)) == 1
    both = costly_gaps(input.optimistic, (ClosedGap(LOW, 1), ClosedGap(HIGH, 2)), 2.0)
    assert side(plan_in(both, input)) == -1


def test_a_way_that_closes_nearby_is_noted_and_one_that_closes_far_away_is_not():
    state = at_rest(global_path=WAY, oriented=True)
    near = make_states(occupied=[(2.0, 2.4, 0.0, 4.0)])
    noted = note_lost_way(make_input(near, LONG), state)
    assert noted.narrows.lost.length_m == pytest.approx(arc_length(WAY))
    assert START[0] < noted.narrows.lost.place[0] < 2.0
    for states in (make_states(occupied=[(4.0, 4.4, 0.0, 4.0)]), make_states()):
        assert note_lost_way(make_input(states, LONG), state) is state


def test_a_gap_has_closed_once_the_robot_takes_a_detour():
    lost = LostWay(LOW, arc_length(WAY), 0)
    short = at_rest(global_path=WAY, lost=lost)
    assert record_closed_gap(make_input(body=LONG), short) is short
    way = np.vstack([WAY, place(GOAL[0], GOAL[1] - DETOUR)])
    detour = changed(short, global_path=way)
    once = record_closed_gap(make_input(body=LONG), detour)
    assert (once.narrows.closed, once.narrows.lost) == ((ClosedGap(LOW, 1),), None)
    nearby = LostWay((LOW[0] + 0.3, *LOW[1:]), arc_length(WAY), 0)
    twice = record_closed_gap(make_input(body=LONG), changed(once, lost=nearby))
    assert twice.narrows.closed == (ClosedGap(nearby.place, 2),)
    late = replace(make_input(body=LONG), time_ns=GIVEN_UP_NS + 1)
    assert record_closed_gap(late, detour).narrows.closed == ()
    assert record_closed_gap(late, detour).narrows.lost is None


def test_without_closed_gaps_the_input_is_the_same():
    input = make_input(body=LONG)
    assert with_closed_gaps(input, at_rest()) is input
    avoiding = with_closed_gaps(input, at_rest(closed=(ClosedGap(LOW, 1),)))
    assert avoiding.spaces.avoids_gaps
    assert avoiding.spaces.guided.prices.any()
