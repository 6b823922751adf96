"""A step to the first pose of a planned way, where the path has no room."""

from dataclasses import replace

import numpy as np
import pytest

from tests.harness.stack.make_input import (
    CELL,
    LONG,
    SIDLES,
    at_rest,
    changed,
    course_of,
    final_sample,
    make_gait,
    make_input,
    make_states,
)
from wayproof.harness.stack.course import DrivablePart
from wayproof.harness.stack.decide import decide
from wayproof.harness.stack.footprint_checks import first_misfit
from wayproof.harness.stack.footprint_mode import decide_with_footprint
from wayproof.harness.stack.gaits.any_direction import AnyDirection
from wayproof.harness.stack.manoeuvres.pose_step import continue_step, is_stepping, step_to_pose
from wayproof.harness.stack.situation import situation_of
from wayproof.harness.stack.state import PathLoss
from wayproof.maps import OCCUPIED
from wayproof.planners import Body

LANE = make_states(occupied=[(0.0, 8.0, 0.0, 1.7), (0.0, 8.0, 2.4, 4.0)])  # 0.7 m wide
ACROSS = 0.15  # heading off the lane, rad


def lane_course(input, state):
    """The course of a robot whose path is blocked where it rests."""
    state = changed(state, global_path=np.array([input.position, input.goal]))
    return course_of(input, state, part=DrivablePart(0.0, blocked=True))


def in_lane(**others):
    return make_input(LANE, LONG, heading=ACROSS, gait=SIDLES, **others)


def test_the_step_ends_at_a_pose_where_the_body_fits():
    input, state = in_lane(), at_rest(heading=ACROSS)
    stepped = step_to_pose(lane_course(input, state))
    trajectory, reason = stepped.command.trajectory, stepped.command.reason
    end = final_sample(trajectory)
    assert first_misfit(input.traversable, trajectory) is None
    assert reason.kind == "following"
    assert reason.free_m == pytest.approx(end.arc_length, abs=1e-5)
    assert abs(end.heading - ACROSS) + reason.free_m > 0.05
    assert stepped.state.global_path is None


def test_a_step_under_way_goes_on_as_long_as_the_body_fits():
    input, state = in_lane(), at_rest(heading=ACROSS)
    stepped = step_to_pose(lane_course(input, state))
    loss = decide(input, replace(stepped.state, path_loss=None)).state.path_loss
    assert loss is None or loss.under_way != "step"  # not by a decision of another kind
    taken = changed(stepped.state, committed=(stepped.command.trajectory,))
    assert not is_stepping(taken, taken.trajectory.at(in_lane(sequence=2).effect_ns))
    soon = in_lane(sequence=1)
    loss = PathLoss(1, stepped.command.under_way, "none")
    under_way = changed(taken, path_loss=loss)
    assert is_stepping(under_way, under_way.trajectory.at(soon.effect_ns))
    blocked = make_input(
        make_states(occupied=[(0.0, 8.0, 0.0, 4.0)]),
        LONG,
        heading=ACROSS,
        sequence=1,
        gait=SIDLES,
    )
    assert continue_step(situation_of(blocked, under_way)) is None
    going = continue_step(situation_of(soon, under_way))
    assert going.command.trajectory is taken.trajectory


def test_round_bodies_take_no_such_step():
    input = make_input(gait=make_gait(AnyDirection, sideways_speed=0.4))
    assert step_to_pose(lane_course(input, at_rest(heading=ACROSS))) is None


def test_a_way_that_there_is_not_takes_no_step():
    closed = make_states(
        occupied=[(0.0, 8.0, 0.0, 1.7), (0.0, 8.0, 2.4, 4.0), (3.0, 3.5, 0.0, 4.0)]
    )
    input = make_input(closed, LONG, gait=SIDLES)
    state = at_rest()
    assert step_to_pose(lane_course(input, state)) is None
    assert np.array_equal(state.trajectory.path[0], input.position)


def test_a_step_under_way_is_checked_by_the_footprint_that_takes_it():
    """The circumscribed footprint has no headings to check it by."""
    state = at_rest(heading=ACROSS)
    first = in_lane()
    stepped = step_to_pose(lane_course(first, state))
    step = changed(stepped.state, committed=(stepped.command.trajectory,))
    step = changed(step, oriented=True, path_loss=PathLoss(0, "step", "none"))
    x, y, _ = (final_sample(step.trajectory).position / CELL).astype(int)
    seen = LANE.copy()
    seen[x - 1 : x + 2, y - 1 : y + 2] = OCCUPIED  # where it leads
    room = {"heading": ACROSS, "gait": SIDLES, "sequence": 1}
    wide, narrow = (
        make_input(seen, body, **room)
        for body in (Body((0.0,), (LONG.circumscribed_radius,)), LONG)
    )
    assert first_misfit(narrow.traversable, step.trajectory, 0.2) is not None
    decided = decide_with_footprint(wide, lambda: narrow, step)
    assert decided.command.trajectory is not step.trajectory
    assert decided.command.under_way != "step"
