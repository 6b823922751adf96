"""Gaps that closed before the robot, and what they cost on the next way."""

from dataclasses import replace

import numpy as np
import pytest

from tests.harness.stack.make_input import (
    GOAL,
    LONG,
    START,
    at_rest,
    changed,
    make_input,
    make_states,
    place,
)
from wayproof.harness.stack.prices import (
    DETOUR,
    GIVEN_UP_NS,
    costly_gaps,
    note_lost_way,
    record_closed_gap,
    with_closed_gaps,
)
from wayproof.harness.stack.state import ClosedGap, LostWay
from wayproof.harness.stack.types import arc_length
from wayproof.planners import plan

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


def test_costs_neither_free_nor_block_a_cell_and_leave_the_space_as_it_was():
    space = make_input(TWO_GAPS, LONG).optimistic
    costly = costly_gaps(space, (ClosedGap(LOW, 2),), 2.0)
    assert costly.distances is space.distances
    assert 10 < np.count_nonzero(costly.prices) < 60
    path = np.array([place(2.0, 0.95), place(5.0, 0.95)])
    assert costly.path_cost(path, 2.0) - space.path_cost(path, 2.0) > 3.9


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
