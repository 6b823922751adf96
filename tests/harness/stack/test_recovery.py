"""Escape, explore, backtrack, wait, hold and abort; each called alone."""

import numpy as np
import pytest

from tests.harness.stack.make_input import (
    GOAL,
    LONG,
    PERIOD_NS,
    START,
    at_rest,
    changed,
    drive,
    final_sample,
    make_gait,
    make_input,
    make_states,
    next_input,
    place,
    top_speed,
)
from wayproof.harness.stack.decide import decide
from wayproof.harness.stack.gaits import AnyDirection, Flight, TurnThenGo
from wayproof.harness.stack.global_path import project_goal_to_free
from wayproof.harness.stack.manoeuvres.escape import ESCAPE_SPEED_SHARE, escape_inflation
from wayproof.harness.stack.manoeuvres.lost_pose import hold_position
from wayproof.harness.stack.manoeuvres.recovery import (
    BACKTRACK_LENGTH,
    RECOVERIES,
    Wait,
    backtrack_path,
    record_breadcrumb,
)
from wayproof.harness.stack.manoeuvres.stopping import stop_without_path, wait
from wayproof.harness.stack.reasons import Reason
from wayproof.harness.stack.situation import first_that_applies, situation_of
from wayproof.harness.stack.state import Exploration
from wayproof.harness.stack.types import BehaviourConfig
from wayproof.planners import Body

BESIDE = (2.05, 2.05)
BETWEEN = [(0.0, 2.6, 0.0, 2.0), (0.0, 2.6, 2.3, 4.0)]
"""Unknown space on both sides of the robot."""

PILLAR = (2.3, 2.4, 2.1, 2.2)

WALL = (4.0, 4.3, 0.0, 4.0)
"""From one side of the room to the other, between start and goal."""

CORNER = (2.5, 4.0, 3.0, 4.0)
"""A corner before the wall, which may be unknown."""

REASON = Reason("no_path", iterations=12)


@pytest.mark.parametrize(("pillars", "action"), [([], "recover"), ([PILLAR], "stop_and_wait")])
def test_an_escape_does_not_brush_an_obstacle(pillars, action):
    """In a lane, a cell from unknown space; the way out leads past the pillar."""
    input = make_input(make_states(unknown=BETWEEN, occupied=pillars), position=BESIDE)
    command, _ = decide(input, at_rest(BESIDE))
    assert (command.action, command.label) == (action, "start_blocked")
    assert command.reason.kind == "leaving_inflation"
    assert (command.reason.distance_m is None) == (command.under_way != "escape") == bool(pillars)


def test_an_escape_of_the_circumscribed_disc_drags_no_disc_of_the_body_over_an_obstacle():
    """The centre stands beside a wall, and leaves it; the pillar is as far, beside the nose."""
    states = make_states(occupied=[(0.0, 8.0, 0.0, 1.9), (1.2, 1.3, 2.1, 2.2)])
    discs = tuple(zip(LONG.offsets, LONG.radii, strict=True))
    input = make_input(states, Body((0.0,), (0.5,)), gait=make_gait(Flight, discs=discs))
    command, _ = escape(input, at_rest())
    assert (command.action, command.reason.distance_m) == ("stop_and_wait", None)


def escape(input, state):
    return escape_inflation(situation_of(input, state))


def test_an_escape_leads_straight_and_slowly_to_the_nearest_traversable_position():
    input = make_input(make_states(occupied=[(0.0, 0.8, 0.0, 4.0)]))
    state = at_rest()
    command, after = escape(input, state)
    assert (command.action, command.label) == ("recover", "start_blocked")
    target = final_sample(command.trajectory).position
    assert input.traversable.is_free(target)
    assert not input.traversable.is_free(input.position)
    assert np.linalg.norm(target - input.position) == pytest.approx(
        command.reason.distance_m, abs=1e-6
    )
    assert command.reason.distance_m < 0.15
    assert top_speed(command.trajectory) <= ESCAPE_SPEED_SHARE * input.gait.limits.speed + 1e-9
    assert after.route is None


@pytest.mark.parametrize(("kind", "sideways"), [(TurnThenGo, 0.0), (AnyDirection, 0.4)])
def test_a_long_body_leaves_the_inflation_at_its_heading(kind, sideways):
    """Its discs are checked at that heading; the disc about them has none of its own."""
    states = make_states(occupied=[(0.0, 0.6, 0.0, 4.0)])
    about = Body((0.0,), (0.5,))
    input = make_input(
        states,
        about,
        heading=1.2,
        gait=make_gait(kind, LONG, sideways_speed=sideways),
    )
    command, _ = escape(input, at_rest(heading=1.2))
    assert command.under_way == "escape"
    assert final_sample(command.trajectory).heading == 1.2


def test_a_long_body_turns_out_of_the_inflation_by_the_smallest_turn_that_helps():
    lane = make_states(occupied=[(0.0, 8.0, 0.0, 1.7), (0.0, 8.0, 2.4, 4.0)])
    input = make_input(lane, LONG, position=(3.05, 2.05), heading=0.7)
    command, _ = escape(input, at_rest((3.05, 2.05), heading=0.7))
    end = final_sample(command.trajectory)
    np.testing.assert_array_equal(end.position, input.position)
    assert input.traversable.pose_free(end.position, end.heading)
    nearer = end.heading + 0.1  # the turns are tried in tenths of a radian
    assert not input.traversable.pose_free(end.position, nearer)
    assert command.reason.turn_rad == pytest.approx(end.heading - 0.7, abs=1e-5)


def test_a_long_body_moves_out_of_the_inflation_where_that_is_less_than_a_turn():
    """A pillar right before its nose, which a step back or a turn would free."""
    input = make_input(make_states(occupied=[(1.5, 1.6, 2.0, 2.1)]), LONG)
    assert not input.traversable.pose_free(input.position, 0.0)
    assert any(input.traversable.pose_free(input.position, 0.1 * n) for n in range(9))
    command, _ = escape(input, at_rest())
    end = final_sample(command.trajectory)
    assert end.heading == 0.0
    assert input.traversable.pose_free(end.position, 0.0)
    assert command.reason.distance_m < 0.2


def waiting(seconds, states=None, **state):
    """Situation of a wait at the start that has lasted for some time, and what was decided."""
    sequence = round(seconds * 1e9) // PERIOD_NS
    input = make_input(states, sequence=sequence)
    state = at_rest(rest_since_ns=0, **state)
    situation = situation_of(input, state)
    return situation, wait(input, state, situation.start, "no_path", REASON)


def recover(situation, decided):
    return first_that_applies(RECOVERIES, Wait(situation, decided))


def test_a_wait_goes_on_until_the_timeout():
    assert BehaviourConfig().wait_timeout == 1.0
    for seconds, same in ((0.9, True), (1.0, False)):
        states = make_states(occupied=[WALL], unknown=[CORNER])
        situation, decided = waiting(seconds, states)
        assert (recover(situation, decided) is decided) is same


@pytest.mark.parametrize(("viewpoints", "action"), [(11, "explore"), (12, "abort")])
def test_the_mission_is_aborted_after_as_many_explorations_as_allowed(viewpoints, action):
    assert BehaviourConfig().max_recoveries == 12
    places = np.tile(place(*START), (viewpoints, 1))
    states = make_states(occupied=[WALL], unknown=[CORNER])
    command, after = recover(*waiting(1.0, states, viewpoints=places))
    assert command.action == action
    assert len(after.tries.viewpoints) == 12


def test_an_abort_keeps_the_reason_of_the_wait_and_counts_the_viewpoints():
    places = np.tile(place(*START), (12, 1))
    situation, decided = waiting(1.5, viewpoints=places)
    command, after = recover(situation, decided)
    assert (command.action, command.label) == ("abort", "no_path")
    assert command.reason.places == 12
    assert command.reason.iterations == REASON.iterations
    assert command.reason.waited_s == pytest.approx(1.5, abs=1e-6)
    assert after is decided.state


def test_exploration_leads_to_the_unknown_corner_and_remembers_the_viewpoint():
    states = make_states(occupied=[WALL], unknown=[CORNER])
    situation, decided = waiting(1.0, states)
    input = situation.input
    command, after = recover(situation, decided)
    assert (command.action, command.reason.kind) == ("explore", "looking_elsewhere")
    end = after.global_path[-1]
    assert 2.2 < end[0] < 4.0
    assert 2.3 < end[1] < 3.0
    assert input.traversable.is_free(end)
    assert after.exploration == Exploration(since=input.sequence)
    np.testing.assert_array_equal(after.tries.viewpoints, [place(*START)])
    assert command.search.waypoints is not None
    assert command.search_seed > 0
    assert after.rest_since_ns == -1


def test_without_a_frontier_the_robot_backtracks_and_without_breadcrumbs_it_waits_once_more():
    states = make_states(occupied=[WALL])
    situation, decided = waiting(1.0, states)
    command, after = recover(situation, decided)
    assert (command.action, command.label) == ("stop_and_wait", "no_path")
    assert command.reason.frontier == "none"
    assert after.exploration is None
    assert after.global_path is None
    crumbs = np.array([place(x, 2.05) for x in np.arange(2.05, 1.0, -0.1)])
    state = changed(decided.state, breadcrumbs=crumbs)
    command, after = recover(situation, decided._replace(state=state))
    assert (command.action, command.reason.kind) == ("recover", "going_back")
    assert after.exploration.backtracking
    assert after.tries.backtracks == 1


def test_a_frontier_explored_from_before_is_not_chosen_again():
    states = make_states(occupied=[WALL], unknown=[CORNER])
    situation, decided = waiting(1.0, states)
    _, after = recover(situation, decided)
    seen = changed(decided.state, viewpoints=after.global_path[-1:])
    _, again = recover(situation, decided._replace(state=seen))
    assert np.linalg.norm(again.global_path[-1] - after.global_path[-1]) > 0.3


def test_an_escape_that_is_under_way_goes_on_until_the_body_is_free():
    """At the heading that it has, one decision after the other, and then to the goal."""
    room = {
        "states": make_states(occupied=[(0.0, 0.95, 0.0, 4.0)]),
        "gait": make_gait(Flight, sideways_speed=0.3),
    }
    state, kinds = at_rest(heading=1.0), []
    for sequence in range(25):
        command, state = decide(next_input(state, sequence, **room), state)
        kinds.append(command.reason.kind)
        if command.reason.kind == "leaving_inflation":
            assert final_sample(command.trajectory).heading == 1.0
    escapes = kinds.count("leaving_inflation")
    assert escapes > 3
    assert kinds[:escapes] == ["leaving_inflation"] * escapes
    assert "stop_and_wait" not in kinds
    assert kinds[-1] == "following"


def test_an_escape_whose_end_was_taken_is_given_up():
    first = make_states(occupied=[(0.0, 0.95, 0.0, 4.0)])
    state = at_rest()
    for sequence in range(3):
        _, state = decide(next_input(state, sequence, states=first), state)
    end = final_sample(state.trajectory).position
    taken = make_states(occupied=[(0.0, 0.95, 0.0, 4.0), (end[0] + 0.2, 8.0, 0.0, 4.0)])
    command, _ = decide(next_input(state, 3, states=taken), state)
    assert command.action == "stop_and_wait"


CRUMBS = np.array([place(x, 2.05) for x in np.linspace(1.05, 3.05, 21)])
END = (3.05, 2.05)


def path_back(states=None, crumbs=CRUMBS, position=END, **state):
    """The path back of a robot at rest."""
    input = make_input(states, position=position)
    state = at_rest(position, breadcrumbs=crumbs, **state)
    return backtrack_path(input, state, state.trajectory.at(input.effect_ns))


def test_a_breadcrumb_is_dropped_at_each_spacing():
    state = at_rest()
    for x, count in ((1.0, 1), (1.09, 1), (1.11, 2), (1.2, 2), (1.22, 3)):
        state = record_breadcrumb(state, make_input(position=(x, 2.05)))
        assert len(state.trails.breadcrumbs) == count
    np.testing.assert_array_equal(state.trails.breadcrumbs[:, 0], [1.0, 1.11, 1.22])


def test_the_path_back_is_the_breadcrumbs_reversed_for_the_backtrack_length():
    path = path_back()
    np.testing.assert_array_equal(path[0], place(*END))
    assert (np.diff(path[:, 0]) < 0.0).all()
    assert path[-1, 0] == pytest.approx(END[0] - BACKTRACK_LENGTH)
    np.testing.assert_allclose(path[:, 1], 2.05)


def test_the_path_back_ends_where_it_is_no_longer_traversable():
    path = path_back(make_states(occupied=[(1.9, 2.1, 0.0, 4.0)]))
    assert 2.4 <= path[-1, 0] < 2.5  # 0.3 m from the wall
    assert path_back(make_states(occupied=[(2.4, 2.6, 0.0, 4.0)])) is None  # less than 0.3 m


def test_there_is_no_path_back_without_breadcrumbs_or_after_the_last_backtrack():
    assert path_back(crumbs=np.empty((0, 3))) is None
    assert path_back(crumbs=CRUMBS[-1:]) is None
    most = BehaviourConfig().max_backtracks
    assert path_back(backtracks=most - 1) is not None
    assert path_back(backtracks=most) is None


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
