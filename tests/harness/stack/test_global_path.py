"""Keeping, replanning and projecting: the global path."""

from dataclasses import replace

import numpy as np
import pytest

from tests.harness.stack.make_input import (
    CELL,
    GOAL,
    LONG,
    PERIOD_NS,
    START,
    at_rest,
    drive,
    make_input,
    make_space,
    make_states,
    next_input,
    place,
)
from wayproof.harness.stack.decide import decide
from wayproof.harness.stack.gait import REPLAN_PERIOD
from wayproof.harness.stack.global_path import (
    ARRIVED,
    keep_or_replan,
    project_goal_to_free,
)
from wayproof.harness.stack.state import Exploration
from wayproof.harness.stack.types import arc_length
from wayproof.maps import OCCUPIED
from wayproof.planners import arc_lengths

STRAIGHT = np.array([place(*START), place(*GOAL)])
DETOUR = np.array([place(*START), place(3.05, 3.55), place(*GOAL)])
WALL = (4.0, 4.3, 0.0, 3.0)
"""A wall with an opening of 1 m at its end."""


def replanned(input, state):
    return keep_or_replan(input, state, state.trajectory.at(input.effect_ns))


def test_a_valid_path_is_kept_until_the_replan_period_has_passed():
    period = round(REPLAN_PERIOD * 1e9) // PERIOD_NS
    state = at_rest(global_path=STRAIGHT)
    planned = replanned(make_input(sequence=period - 1), state)
    assert planned.search is None
    np.testing.assert_array_equal(planned.state.global_path, STRAIGHT)
    planned = replanned(make_input(sequence=period), state)
    assert planned.search is not None
    assert planned.state.route.improved_ns == period * PERIOD_NS


def test_a_path_to_another_place_than_the_goal_is_replanned():
    near = np.array([place(*START), place(GOAL[0] - 2 * CELL, GOAL[1])])
    far = np.array([place(*START), place(GOAL[0] - 4 * CELL, GOAL[1])])
    for path, searched in ((near, False), (far, True)):
        planned = replanned(make_input(), at_rest(global_path=path))
        assert (planned.search is not None) is searched


def test_an_exploration_is_dropped_for_any_way_to_the_goal_and_else_kept():
    to_corner = np.array([place(*START), place(1.05, 3.05)])
    exploring = at_rest(global_path=to_corner, exploration=Exploration(since=1))
    planned = replanned(make_input(sequence=20), exploring)
    assert planned.state.exploration is None
    np.testing.assert_allclose(planned.state.global_path[-1], place(*GOAL))
    walled = make_states(occupied=[(4.0, 4.3, 0.0, 4.0)])
    planned = replanned(make_input(walled, sequence=20), exploring)
    assert planned.state.exploration == Exploration(since=1)
    np.testing.assert_array_equal(planned.state.global_path, to_corner)


def test_an_exploration_ends_at_its_viewpoint():
    here = np.array([place(*START), place(START[0] + 0.9 * ARRIVED, START[1])])
    wall = make_states(occupied=[(4.0, 4.3, 0.0, 4.0)])
    state = at_rest(global_path=here, exploration=Exploration(since=1))
    planned = replanned(make_input(wall), state)
    assert planned.state.global_path is None
    assert planned.state.exploration is None


def test_a_robot_at_rest_beside_a_goal_that_became_free_goes_on_to_it():
    here = np.array([place(*START), place(*START)])
    input = replace(make_input(sequence=20), goal=place(START[0] + 2 * CELL, START[1]))
    state = at_rest(global_path=here, improved_ns=20 * PERIOD_NS)
    planned = replanned(input, state)
    np.testing.assert_allclose(planned.state.global_path[[0, -1]], [here[0], input.goal])


def test_a_goal_inside_the_inflation_is_projected_to_the_nearest_free_position():
    states = make_states(occupied=[(6.5, 8.0, 0.0, 4.0)])
    input = make_input(states, goal=(6.45, 2.05))
    goal = project_goal_to_free(input)
    assert input.optimistic.is_free(goal)
    assert goal[0] == pytest.approx(6.15, abs=0.051)
    long = make_input(states, goal=(6.45, 2.05), body=LONG)
    goal = project_goal_to_free(long)
    assert 6.0 < goal[0] < 6.4
    headings = np.linspace(0.0, np.pi, 8, endpoint=False)
    assert any(long.optimistic.pose_free(goal, heading) for heading in headings)


BEHIND = [(3.0, 8.0, 0.0, 4.0)]
"""The unknown part of a room."""


def guided_by(*occupied):
    """The input of a room whose far part is unknown, with a prior map of what stands in it."""
    guide = make_space(make_states(occupied=occupied) == OCCUPIED)
    return make_input(make_states(unknown=BEHIND), guided=guide)


def test_a_path_goes_round_what_only_a_prior_map_knows():
    free = replanned(guided_by(), at_rest()).state.global_path
    np.testing.assert_allclose(free[[0, -1]], STRAIGHT)
    turned = replanned(guided_by(WALL), at_rest()).state.global_path
    assert turned[:, 1].max() > 3.2
    assert arc_length(turned) > arc_length(free) + 0.5


def test_where_a_prior_map_leaves_no_way_the_search_goes_on_without_it():
    closed = replanned(guided_by((4.0, 4.3, 0.0, 4.0)), at_rest())
    np.testing.assert_allclose(closed.state.global_path[[0, -1]], STRAIGHT)


def test_a_path_through_what_only_a_prior_map_holds_is_kept_until_there_is_a_better_one():
    input = guided_by(WALL)
    kept = replanned(input, at_rest(global_path=STRAIGHT))
    np.testing.assert_array_equal(kept.state.global_path, STRAIGHT)
    due = round(REPLAN_PERIOD * 1e9) // PERIOD_NS
    later = replace(input, time_ns=due * PERIOD_NS, effect_ns=(due + 1) * PERIOD_NS, sequence=due)
    assert replanned(later, at_rest(global_path=STRAIGHT)).state.global_path[:, 1].max() > 3.2


def test_of_two_paths_that_a_prior_map_blocks_the_cheaper_one_without_it_is_taken():
    guide = make_space(make_states(occupied=[(4.0, 4.3, 0.0, 4.0)]) == OCCUPIED)
    input = make_input(make_states(unknown=BEHIND), sequence=20, guided=guide)
    planned = replanned(input, at_rest(global_path=DETOUR))
    assert arc_length(planned.state.global_path) < arc_length(DETOUR) - 0.3


def test_a_path_is_planned_from_the_end_of_a_stop_that_is_under_way():
    """It began to stop before a wall, which then turned out to be narrow."""
    state = drive(8)
    x = round(state.trajectory.at(9 * PERIOD_NS).position[0], 1)
    wall = make_states(occupied=[(x + 0.7, 8.0, 0.0, 4.0)])
    _, state = decide(next_input(state, 8, states=wall), state)
    assert state.global_path is None
    post = make_states(occupied=[(x + 2.0, x + 2.3, 1.8, 2.3)])
    input = next_input(state, 9, states=post)
    start = state.trajectory.at(input.effect_ns)
    assert start.speed > 0.5
    path = keep_or_replan(input, state, start).state.global_path
    assert path[-1] == pytest.approx(place(*GOAL))
    np.testing.assert_allclose(path[0], start.position, atol=1e-9)
    assert input.traversable.free_length(path) == pytest.approx(arc_lengths(path)[-1])
