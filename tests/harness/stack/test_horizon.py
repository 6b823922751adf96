"""Intermediate goals where the goal lies beyond the rolling window."""

import numpy as np
import pytest

from tests.harness.stack.make_input import (
    GOAL,
    START,
    at_rest,
    drive,
    make_input,
    make_states,
    place,
)
from wayproof.harness.stack.decide import decide
from wayproof.harness.stack.horizon import RENEW, exit_of, goal_within
from wayproof.harness.stack.types import Horizon

LOW, HIGH = np.array([0.5, 0.5]), np.array([7.5, 3.5])
FAR = (60.0, 2.05)


def straight(start, goal):
    return np.stack([start[:2], goal[:2]])


def refused(start, goal):
    raise AssertionError(f"asked for a way from {start} to {goal}")


def within(input, state):
    return goal_within(input, state, state.trajectory.at(input.effect_ns))


def test_a_way_leaves_a_box_where_its_first_edge_crosses_a_face():
    way = np.array([[1.0, 1.0], [3.0, 1.0], [3.0, 9.0], [1.0, 1.0]])
    np.testing.assert_allclose(exit_of(way, LOW, HIGH), [3.0, 3.5])
    np.testing.assert_allclose(exit_of(way[:2], LOW, HIGH), [3.0, 1.0])
    through_a_corner = np.array([[6.5, 2.5], [9.5, 5.5]])
    np.testing.assert_allclose(exit_of(through_a_corner, LOW, HIGH), [7.5, 3.5])
    steep = np.array([[6.5, 2.5], [7.0, 6.5]])
    np.testing.assert_allclose(exit_of(steep, LOW, HIGH), [6.625, 3.5])


def test_a_way_from_beyond_a_box_leaves_it_at_the_nearest_point():
    way = np.array([[8.0, 2.0], [20.0, 2.0]])
    np.testing.assert_allclose(exit_of(way, LOW, HIGH), [7.5, 2.0])


def test_a_goal_in_the_window_is_the_goal_and_no_way_is_asked_for():
    input = make_input(horizon=Horizon(LOW, HIGH, refused))
    assert within(input, at_rest()) is input.goal
    assert within(make_input(goal=FAR), at_rest())[0] == FAR[0]  # no window at all


def test_a_goal_beyond_it_is_replaced_by_where_the_way_leaves():
    input = make_input(goal=FAR, horizon=Horizon(LOW, HIGH, straight))
    np.testing.assert_allclose(within(input, at_rest())[:2], [HIGH[0], START[1]], atol=0.1)


def test_without_a_way_it_lies_straight_towards_the_goal():
    input = make_input(goal=(60.0, 40.0), horizon=Horizon(LOW, HIGH, lambda *_: None))
    found = within(input, at_rest())
    assert found[1] == pytest.approx(HIGH[1], abs=0.11)
    assert START[0] < found[0] < HIGH[0]


def test_it_is_projected_to_free_space():
    states = make_states(occupied=[(7.3, 7.7, 1.8, 2.3)])
    input = make_input(states, goal=FAR, horizon=Horizon(LOW, HIGH, straight))
    found = within(input, at_rest())
    assert input.optimistic.is_free(found)
    assert abs(found[0] - HIGH[0]) < 1.0


def test_an_intermediate_goal_is_kept_while_its_path_is_valid_and_long():
    path = np.array([place(*START), np.add(place(*START), (RENEW + 0.1, 0.0, 0.0))])
    input = make_input(goal=FAR, horizon=Horizon(LOW, HIGH, refused))
    np.testing.assert_array_equal(within(input, at_rest(global_path=path)), path[-1])
    blocked = make_states(occupied=[(4.0, 4.3, 0.0, 4.0)])
    for states, end in ((blocked, path[-1]), (None, place(*GOAL))):
        renewed = make_input(states, goal=FAR, horizon=Horizon(LOW, HIGH, straight))
        state = at_rest(global_path=np.stack([path[0], end]))
        np.testing.assert_allclose(within(renewed, state)[:2], [HIGH[0], START[1]], atol=0.1)


def test_a_robot_drives_on_towards_a_goal_beyond_the_window():
    horizon = Horizon(LOW, HIGH, straight)
    command, state = decide(make_input(goal=FAR, horizon=horizon), at_rest())
    assert command.action == "follow"
    assert FAR[0] - command.global_path[-1][0] == pytest.approx(FAR[0] - HIGH[0], abs=0.1)
    moved = drive(20, state, goal=FAR, horizon=horizon)
    assert moved.trajectory.path[-1][0] > START[0] + 1.0
