"""Which action, label and reason a decision has, in rooms made by hand."""

from dataclasses import dataclass
from typing import get_args

import numpy as np
import pytest

from tests.harness.stack.make_input import (
    CELL,
    GOAL,
    LONG,
    PERIOD_NS,
    START,
    TURNS,
    at_rest,
    drive,
    make_input,
    make_states,
    next_input,
    place,
    sample_at,
)
from wayproof.harness.behaviour_config import BehaviourConfig
from wayproof.harness.decision import Action, Label
from wayproof.harness.stack import obstruction
from wayproof.harness.stack.decide import decide
from wayproof.harness.stack.reasons import Kind
from wayproof.harness.stack.state import PlannerState
from wayproof.harness.stack.types import PlannerInput

WALL = (4.0, 4.3, 0.0, 4.0)
"""From one side of the room to the other, between start and goal."""

NAVIGATORS_OWN = {"deadline_missed"}
"""Labels that `decide` does not give."""


@dataclass(frozen=True)
class Case:
    """What a decision is made on."""

    input: PlannerInput
    state: PlannerState


def seen_from_rest(**room):
    return Case(make_input(**room), at_rest())


def seen_in_motion(states, decisions=8, **room):
    """It drives in a free room, and then sees another one."""
    state = drive(decisions, **room)
    return Case(next_input(state, decisions, states=states, **room), state)


def waited(states, seconds, **state):
    """It has been at rest from the first decision on, before a way that is not open."""
    sequence = round(seconds * 1e9) // PERIOD_NS
    return Case(make_input(states, sequence=sequence), at_rest(rest_since_ns=0, **state))


def all_the_way_is_free():
    return seen_from_rest()


def what_is_left_takes_braking():
    state = drive(32)
    return Case(next_input(state, 32), state)


def a_sharp_corner_comes_first():
    bent = np.array([place(1.05, 2.05), place(3.05, 2.05), place(3.05, 3.55)])
    input = make_input(goal=(3.05, 3.55))
    return Case(input, at_rest(global_path=bent))


def the_far_end_is_unknown():
    return seen_from_rest(states=make_states(unknown=[(5.0, 8.0, 0.0, 4.0)]))


def the_next_metre_is_unknown():
    return seen_from_rest(states=make_states(unknown=[(2.2, 8.0, 0.0, 4.0)]))


def unknown_space_costs_speed():
    return seen_from_rest(states=make_states(unknown=[(2.2, 8.0, 0.0, 4.0)]), policy="penalize")


def unknown_space_is_like_free():
    return seen_from_rest(states=make_states(unknown=[(2.2, 8.0, 0.0, 4.0)]), policy="allow")


def the_goal_lies_behind_a_robot_on_the_ground():
    input = make_input(position=(4.05, 2.05), goal=(1.05, 2.05), gait=TURNS)
    return Case(input, at_rest((4.05, 2.05)))


def the_unknown_begins_right_ahead():
    return seen_from_rest(states=make_states(unknown=[(1.6, 8.0, 0.0, 4.0)]))


def the_unknown_comes_nearer_in_motion():
    x = sample_at(drive(8), 8 * PERIOD_NS).position[0]
    return seen_in_motion(make_states(unknown=[(round(x, 1) + 0.9, 8.0, 0.0, 4.0)]))


def a_wall_comes_into_the_way_in_motion():
    x = sample_at(drive(8), 8 * PERIOD_NS).position[0]
    return seen_in_motion(make_states(occupied=[(round(x, 1) + 0.9, 8.0, 0.0, 4.0)]))


def a_wall_came_into_the_way_before():
    case = a_wall_comes_into_the_way_in_motion()
    _, state = decide(case.input, case.state)
    x = sample_at(drive(8), 8 * PERIOD_NS).position[0]
    wall = make_states(occupied=[(round(x, 1) + 0.9, 8.0, 0.0, 4.0)])
    return Case(next_input(state, 9, states=wall), state)


def a_wall_shuts_off_the_goal():
    return seen_from_rest(states=make_states(occupied=[WALL]))


def a_wall_shuts_off_the_goal_and_a_corner_was_not_seen():
    return waited(make_states(occupied=[WALL], unknown=[(2.5, 4.0, 3.0, 4.0)]), seconds=1.5)


def a_wall_shuts_off_the_goal_and_it_came_from_behind():
    trail = np.array([place(x, 2.05) for x in np.arange(2.05, 3.1, 0.1)])
    input = make_input(make_states(occupied=[WALL]), position=(3.05, 2.05), sequence=15)
    return Case(input, at_rest((3.05, 2.05), rest_since_ns=0, breadcrumbs=trail))


def it_has_looked_from_everywhere():
    tries = BehaviourConfig().max_recoveries
    return waited(make_states(occupied=[WALL]), 1.5, viewpoints=np.tile(place(*START), (tries, 1)))


def the_goal_lies_deep_in_a_block():
    block = make_states(occupied=[(5.0, 8.0, 0.0, 4.0)])
    return Case(make_input(block, goal=(7.05, 2.05)), at_rest())


def it_stands_as_near_to_a_blocked_goal_as_it_can():
    block = make_states(occupied=[(6.5, 6.7, 2.0, 2.2)])
    state = drive(60, states=block)
    return Case(next_input(state, 60, states=block), state)


def a_blocked_goal_did_not_become_free():
    block = make_states(occupied=[(6.5, 6.7, 2.0, 2.2)])
    state = drive(110, states=block)
    return Case(next_input(state, 110, states=block), state)


def a_block_touches_its_inflation():
    return seen_from_rest(states=make_states(occupied=[(0.0, 0.8, 0.0, 4.0)]))


def all_about_it_is_occupied():
    return seen_from_rest(states=make_states(occupied=[(0.0, 4.0, 0.0, 4.0)]))


def a_long_body_lies_askew_in_a_lane():
    lane = make_states(occupied=[(0.0, 8.0, 0.0, 1.7), (0.0, 8.0, 2.4, 4.0)])
    input = make_input(lane, LONG, position=(3.05, 2.05), heading=0.7)
    return Case(input, at_rest((3.05, 2.05), heading=0.7))


def it_stands_a_metre_beside_its_trajectory():
    return Case(make_input(position=(1.05, 3.05)), at_rest())


def seen_at_the_start(places):
    """What lies beyond 1 m ahead was last seen at the start, all else now."""
    return np.where(places[:, 0] > START[0] + 1.0, 0, 10**9)


def nothing_has_looked_ahead_since_it_set_out():
    state = drive(8)
    return Case(next_input(state, 8, observed_ns=seen_at_the_start), state)


def nothing_has_looked_since_it_came_to_rest():
    input = make_input(sequence=8, observed_ns=lambda places: np.zeros(len(places)))
    return Case(input, at_rest())


def it_stands_at_the_goal():
    return Case(make_input(position=GOAL), at_rest(GOAL))


CASES = {
    all_the_way_is_free: ("follow", "none", "following"),
    what_is_left_takes_braking: ("follow", "none", "braking_for_goal"),
    a_sharp_corner_comes_first: ("follow", "none", "following"),
    the_far_end_is_unknown: ("follow", "unknown_ahead", "following"),
    the_next_metre_is_unknown: ("slow", "unknown_ahead", "slowing_for_unknown"),
    unknown_space_costs_speed: ("slow", "unknown_ahead", "slowing_for_unknown"),
    unknown_space_is_like_free: ("follow", "none", "following"),
    the_goal_lies_behind_a_robot_on_the_ground: ("follow", "none", "turning"),
    the_unknown_begins_right_ahead: ("stop_and_wait", "unknown_ahead", "waiting"),
    the_unknown_comes_nearer_in_motion: (
        "stop_and_wait",
        "unknown_ahead",
        "braking_for_unknown",
    ),
    a_wall_comes_into_the_way_in_motion: (
        "stop_and_wait",
        "path_blocked",
        "braking_for_blocked",
    ),
    a_wall_came_into_the_way_before: ("stop_and_wait", "path_blocked", "waiting"),
    a_wall_shuts_off_the_goal: ("stop_and_wait", "no_path", "no_path"),
    a_wall_shuts_off_the_goal_and_a_corner_was_not_seen: ("explore", "none", "looking_elsewhere"),
    a_wall_shuts_off_the_goal_and_it_came_from_behind: ("recover", "none", "going_back"),
    it_has_looked_from_everywhere: ("abort", "no_path", "no_path"),
    the_goal_lies_deep_in_a_block: ("stop_and_wait", "goal_blocked", "goal_blocked"),
    it_stands_as_near_to_a_blocked_goal_as_it_can: (
        "stop_and_wait",
        "goal_blocked",
        "goal_blocked",
    ),
    a_blocked_goal_did_not_become_free: ("abort", "goal_blocked", "goal_blocked"),
    a_block_touches_its_inflation: ("recover", "start_blocked", "leaving_inflation"),
    all_about_it_is_occupied: ("stop_and_wait", "start_blocked", "leaving_inflation"),
    a_long_body_lies_askew_in_a_lane: ("recover", "start_blocked", "leaving_inflation"),
    it_stands_a_metre_beside_its_trajectory: ("recover", "localization_lost", "localization_lost"),
    nothing_has_looked_ahead_since_it_set_out: ("stop_and_wait", "map_stale", "old_evidence"),
    nothing_has_looked_since_it_came_to_rest: ("stop_and_wait", "map_stale", "old_evidence"),
    it_stands_at_the_goal: ("goal", "none", "arrived"),
}
"""What each is decided to be: action, label and kind of reason."""


@pytest.mark.parametrize("situation", CASES, ids=lambda one: one.__name__)
def test_a_situation_has_its_action_label_and_reason(situation):
    case = situation()
    command, _ = decide(case.input, case.state)
    assert (command.action, command.label, command.reason.kind) == CASES[situation]


def test_every_action_label_and_kind_of_reason_has_its_situation():
    actions, labels, kinds = map(set, zip(*CASES.values(), strict=True))
    assert actions == set(get_args(Action))
    assert labels == set(get_args(Label)) - NAVIGATORS_OWN
    assert kinds == set(get_args(Kind)) - {"late", "commanded"}


@pytest.mark.parametrize("face", [2.0, 3.0, 5.0])
def test_what_ends_the_free_length_of_a_long_body_may_stand_far_along_an_edge(face):
    input = make_input(make_states(occupied=[(face, 6.0, 0.0, 4.0)]), LONG)
    path = np.array([place(*START), place(*GOAL)])
    free = input.traversable.free_length(path)
    assert free == 0.0
    found = obstruction.on_path(input, path, free, unknown_blocks=True)
    assert found.cell_state == "occupied"
    assert found.cell[0] == pytest.approx(face + 0.05)


def test_a_grazed_cell_is_named_before_one_that_is_overlapped_farther_on():
    corners = np.array([(3.1, 2.2), (3.9, 2.2)])
    states = make_states(occupied=[(x, x + CELL, y, y + CELL) for x, y in corners])
    input = make_input(states, LONG)
    start, end = place(1.51, 1.24), place(5.59, 2.99)
    ahead = (end - start) / np.linalg.norm(end - start)
    path = start + ahead * 0.05 * np.arange(60.0)[:, None]
    free = input.traversable.free_length(path)
    found = obstruction.on_path(input, path, free, unknown_blocks=True)
    assert found.cell[:2] == pytest.approx(corners[0] + 0.5 * CELL)
