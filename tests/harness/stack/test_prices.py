"""What ways through unknown space cost, and how fast they are taken."""

from dataclasses import replace

import numpy as np
import pytest

from tests.harness.stack.make_input import (
    GOAL,
    START,
    TURNS,
    at_rest,
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
    UNKNOWN,
    enough_admitted,
    with_costs,
)
from wayproof.harness.stack.types import BehaviourConfig
from wayproof.maps import FREE, OCCUPIED
from wayproof.planners import stopping_distance

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
