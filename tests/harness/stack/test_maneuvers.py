"""Manoeuvres that end where the robot is."""

import numpy as np
import pytest

from tests.harness.stack.make_input import (
    GOAL,
    PERIOD_NS,
    START,
    at_rest,
    changed,
    drive,
    final_sample,
    make_input,
    make_states,
    next_input,
    place,
)
from wayproof.harness.stack.decide import decide
from wayproof.harness.stack.global_path import project_goal_to_free
from wayproof.harness.stack.manoeuvres.lost_pose import hold_position
from wayproof.harness.stack.manoeuvres.stopping import brake, stop_without_path, wait
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.situation import situation_of
from wayproof.harness.stack.state import Exploration
from wayproof.harness.stack.types import BehaviourConfig

NO_PATH = Reason("no_path", iterations=12)


def standing_at(position, heading=0.0):
    """The start of a new trajectory of a robot at rest."""
    return at_rest(position, heading).trajectory.at(0)


def in_motion(decisions=8):
    """State of a robot that drives, its next input, and the start of its next trajectory."""
    state = drive(decisions)
    input = next_input(state, decisions)
    return state, input, state.trajectory.at(input.effect_ns)


def test_a_robot_off_its_trajectory_holds_the_estimated_pose_and_drops_its_path():
    input = make_input(position=(1.05, 3.05), heading=0.4)
    state = at_rest(global_path=np.array([place(*START), place(*GOAL)]))
    command, after = hold_position(situation_of(input, state))
    assert (command.action, command.label) == ("recover", "localization_lost")
    assert command.reason.distance_m == pytest.approx(1.0, abs=1e-6)
    assert command.reason.limit_m == pytest.approx(BehaviourConfig().tracking_tolerance, abs=1e-6)
    held = command.trajectory.at(input.effect_ns)
    np.testing.assert_array_equal(held.position, input.position)
    assert held.heading == 0.4
    assert held.at_rest
    assert after.global_path is None


@pytest.mark.parametrize(("seconds", "action"), [(4.9, "stop_and_wait"), (5.0, "abort")])
def test_a_robot_beside_a_blocked_goal_waits_for_the_timeout_and_then_aborts(seconds, action):
    assert BehaviourConfig().goal_wait_timeout == 5.0
    sequence = 10 + round(seconds * 1e9) // PERIOD_NS
    block = make_states(occupied=[(6.5, 6.7, 2.0, 2.2)])
    beside = project_goal_to_free(make_input(block))[:2]
    input = make_input(block, sequence=sequence, position=beside)
    state = at_rest(beside, rest_since_ns=10 * PERIOD_NS)
    command, after = decide(input, state)
    assert (command.action, command.label) == (action, "goal_blocked")
    assert command.reason.waited_s == pytest.approx(seconds, abs=1e-6)
    assert command.reason.cell_state == "occupied"
    assert after.rest_since_ns == 10 * PERIOD_NS


def test_a_wait_keeps_the_global_path_and_counts_the_time_from_its_first_decision():
    path = np.array([place(*START), place(*GOAL)])
    state = at_rest(global_path=path)
    start = standing_at(START)
    command, state = wait(make_input(sequence=3), state, start, "no_path", NO_PATH)
    assert (command.action, command.label) == ("stop_and_wait", "no_path")
    assert command.reason.waited_s == 0.0
    assert command.global_path is path
    command, state = wait(make_input(sequence=8), state, start, "no_path", NO_PATH)
    assert command.reason.waited_s == pytest.approx(0.5, abs=1e-6)
    assert state.rest_since_ns == 3 * PERIOD_NS
    assert state.global_path is path


def test_a_robot_that_brakes_stops_on_its_path_and_drops_the_global_path():
    state, input, start = in_motion()
    assert start.speed > 1.0
    path = np.array([start.position, place(*GOAL)])
    command, after = brake(input, state, start, path, NO_PATH, "no_path")
    assert (command.action, command.label, command.reason) == ("stop_and_wait", "no_path", NO_PATH)
    begun = command.trajectory.at(input.effect_ns)
    assert begun.speed == pytest.approx(start.speed)
    np.testing.assert_allclose(begun.position, start.position)
    end = final_sample(command.trajectory).position
    assert start.position[0] + 0.3 < end[0] < GOAL[0]
    assert end[1] == pytest.approx(START[1])
    assert after.global_path is None
    assert after.exploration is None


def test_a_robot_that_has_reached_its_viewpoint_comes_to_rest_there():
    state, input, start = in_motion()
    path = start.position + np.array([[-start.arc_length, 0.0, 0.0], [0.02, 0.0, 0.0]])
    previous = changed(state, global_path=path, exploration=Exploration(since=2))
    x = round(start.position[0] + 0.5, 1)  # a wall before the end of the stop
    walled = next_input(state, 8, states=make_states(occupied=[(x, x + 0.3, 0.0, 4.0)]))
    command, _ = stop_without_path(situation_of(walled, previous))
    assert (command.action, command.label) == ("stop_and_wait", "none")
    assert command.reason.kind == "waiting"
    assert command.reason.since == input.sequence
