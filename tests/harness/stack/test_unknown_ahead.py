"""Unknown space that a robot in flight sees in time costs less."""

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
    with_spaces,
)
from wayproof.harness.config import Config
from wayproof.harness.scenario.scenario import build
from wayproof.harness.stack.footprint import body_of, costs
from wayproof.harness.stack.gaits import Flight
from wayproof.harness.stack.global_path import keep_or_replan
from wayproof.harness.stack.mapping import Mapper
from wayproof.harness.stack.planner_input import FreeSpaceBuilder
from wayproof.harness.stack.prices import (
    ELSEWHERE,
    TRIED_ONCE,
    UNKNOWN,
    discounted_space,
    enough_admitted,
    with_costs,
)
from wayproof.maps import FREE, OCCUPIED
from wayproof.planners import PlannerConfig, plan, stopping_distance

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


def test_a_way_through_unknown_space_far_ahead_is_taken():
    assert lowest_of(room_with(FAR)) > 1.0


def test_unknown_space_before_which_the_robot_would_brake_is_still_avoided():
    assert lowest_of(room_with(NEAR)) < 1.0


@pytest.mark.parametrize("gait", [TURNS, make_gait(Flight, omnidirectional=False)])
def test_a_robot_on_the_ground_or_with_a_camera_alone_pays_in_full(gait):
    assert lowest_of(room_with(FAR, gait=gait)) < 1.0


def test_a_known_detour_is_replaced_by_a_shorter_way_through_unknown_space():
    detour = np.array([place(*START), place(1.05, 0.65), place(6.55, 0.65), place(*GOAL)])
    assert lowest_of(room_with(FAR, sequence=20), global_path=detour) > 1.0


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


def test_only_unknown_space_costs_less():
    input = room_with(FAR)
    space, dear = discounted_space(input), input.optimistic
    assert space.prices is dear.prices
    assert space.cost_by_price[UNKNOWN] == UNKNOWN_COST / 16
    assert space.cost_by_distance is dear.cost_by_distance
    guided = with_costs(dear, {ELSEWHERE: 1.0, TRIED_ONCE: 2.0})
    costs = discounted_space(with_spaces(input, guided=guided)).cost_by_price
    assert costs[UNKNOWN : TRIED_ONCE + 1] == (UNKNOWN_COST / 16, 1.0 / 16, 2.0)


def test_a_way_through_unknown_space_is_taken_where_that_costs_less():
    input = room_with(FAR)
    query = place(*START), place(*GOAL), PlannerConfig(), 1, 0.0
    dear, cheap = plan(input.optimistic, *query), plan(discounted_space(input), *query)
    assert cheap.waypoints[:, 1].min() > 1.0 > dear.waypoints[:, 1].min()


@pytest.mark.parametrize(
    ("robot", "around", "share"),
    [("drone", True, 0.5), ("drone", False, 1.0), ("quadruped", True, 1.0)],
)
def test_nearness_costs_a_robot_that_flies_half_and_the_unknown_as_much(robot, around, share):
    scenario = build(Config("empty", robot, 0))
    costmap = Mapper(scenario.config, scenario.mission, {}).costmap
    builder = FreeSpaceBuilder(scenario.config, scenario.mission, costmap, omnidirectional=around)
    spaces = builder.spaces(circumscribed=True)
    whole = costs(costmap, body_of(scenario.mission))
    np.testing.assert_array_equal(spaces.known_free.cost_by_distance, share * whole)
    assert spaces.optimistic.cost_by_price[UNKNOWN] == UNKNOWN_COST
