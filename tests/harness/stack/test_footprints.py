"""Where an elongated body fits at its heading, and when its way has room to turn."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from tests.harness.stack.make_input import (
    GOAL,
    LONG,
    START,
    at_rest,
    make_input,
    make_states,
    place,
    top_speed,
)
from wayproof.harness.stack.decide import decide
from wayproof.harness.stack.footprint_checks import (
    first_misfit,
    headings_to_start_at,
    truncate_where_turnable,
)
from wayproof.planners import (
    Body,
    FreeSpace,
    MotionLimits,
    PathState,
    follow_path,
    hold,
    turn_in_place,
)

LIMITS = MotionLimits(
    speed=1.0, acceleration=1.5, jerk=15.0, lateral_acceleration=1.5, yaw_rate=1.0
)
BODY = Body((-0.25, 0.0, 0.25), (0.2, 0.2, 0.2))


@pytest.fixture(scope="module")
def lane() -> FreeSpace:
    """A lane of 0.7 m along x from 1 m to 4 m, that opens into a room."""
    blocked = np.zeros((140, 80, 1), dtype=bool)
    blocked[20:80, :33] = blocked[20:80, 47:] = True
    blocked[:20] = True
    field = np.minimum(np.rint(distance_transform_edt(~blocked) ** 2), 900).astype(np.uint16)
    discs = BODY.discs(0.0, 0.05, flat=True)
    return FreeSpace(field, np.zeros(3), 0.05, discs[0].collision_distance_sq, np.zeros(901), discs)


def spot(x: float, y: float = 2.0) -> np.ndarray:
    return np.array([x, y, 0.025])


def path(start: float, end: float) -> np.ndarray:
    return np.array([spot(x) for x in np.linspace(start, end, 41)])


def test_a_trajectory_fits_where_each_of_its_poses_does(lane):
    start = 0, 0.0, 0.0, 0.0
    along = follow_path(path(2.0, 5.5), PathState(*start, 0.0), LIMITS, 1.0)
    assert first_misfit(lane, along) is None
    askew = follow_path(path(2.0, 5.5), PathState(*start, 1.0), LIMITS, 1.0)
    assert first_misfit(lane, askew) == 0.0  # it stands across the lane
    backwards = follow_path(path(3.5, 2.0), PathState(*start, 0.0), LIMITS, 0.4, reverse=True)
    assert first_misfit(lane, backwards) is None
    assert np.abs(backwards.poses(0.1)[:, 3]).max() < 1e-9
    into_the_wall = follow_path(path(2.5, 1.0), PathState(*start, math.pi), LIMITS, 1.0)
    found = first_misfit(lane, into_the_wall)
    assert 0.9 < found < 1.1  # 0.25 m and 0.2 m of its front, half a diagonal, and whole cells
    assert first_misfit(dataclasses.replace(lane, discs=()), into_the_wall) is None


def test_a_turn_is_checked_all_the_way(lane):
    assert first_misfit(lane, turn_in_place(spot(3.0), 0, 0.0, math.pi, LIMITS)) == 0.0
    assert first_misfit(lane, turn_in_place(spot(5.5), 0, 0.0, math.pi, LIMITS)) is None


def test_nose_first_where_it_can_turn_about_and_the_nearer_way_elsewhere(lane):
    wide, narrow = hold(spot(5.5), 0, 0.1).at(0), hold(spot(3.0), 0, 0.1).at(0)
    assert headings_to_start_at(lane, wide, math.pi) == [(math.pi, False)]
    assert headings_to_start_at(lane, narrow, math.pi) == [(2.0 * math.pi, True)]
    assert headings_to_start_at(lane, narrow, 0.0) == [(0.0, False)]
    assert headings_to_start_at(lane, narrow, math.pi / 2) == []


def test_tail_first_to_the_first_place_where_it_turns(lane):
    way = path(2.0, 6.5)
    end = truncate_where_turnable(lane, way, 0.0)[-1, 0]
    assert 4.0 < end < 4.8
    assert lane.turnable(np.array([spot(end)]))[0]
    assert truncate_where_turnable(lane, way, 3.5)[-1, 0] == pytest.approx(5.5, abs=0.12)
    assert truncate_where_turnable(lane, path(2.0, 3.0), 0.0)[-1, 0] == 3.0


GAP = make_states(occupied=[(3.0, 4.5, 0.0, 1.7), (3.0, 4.5, 2.4, 4.0)])
"""A gap of 0.7 m between start and goal: the disc of 1 m does not fit, the body of 0.4 m does."""


def decided_in(states=None, state=None, **room):
    """The command in a room, and the space that its global path was searched in."""
    input = make_input(states, LONG, **room)
    return decide(input, state or at_rest()).command, input.optimistic


def test_where_there_is_room_to_turn_the_way_has_it_all_along():
    command, space = decided_in(make_states(occupied=[(3.0, 3.5, 1.5, 4.0)]))
    assert command.action in ("follow", "slow")
    assert space.turnable_along(command.global_path)


def test_a_gap_too_narrow_for_the_disc_is_taken_at_the_heading():
    command, space = decided_in(GAP)
    assert command.action == "follow"
    assert command.global_path[-1] == pytest.approx(place(*GOAL))
    assert not space.turnable_along(command.global_path)
    inside = np.abs(command.global_path[:, 0] - 3.75) < 0.75
    assert inside.any()
    assert np.abs(command.global_path[inside, 1] - 2.05).max() < 0.2


def test_where_the_body_cannot_turn_it_is_slower():
    narrow, _ = decided_in(GAP)
    wide, _ = decided_in()
    share = make_input(body=LONG).behaviour.narrow_speed_fraction
    assert top_speed(narrow.trajectory) == pytest.approx(share * top_speed(wide.trajectory), 0.01)


def test_where_no_heading_leads_on_there_is_no_path():
    command, _ = decided_in(make_states(occupied=[(3.0, 4.5, 0.0, 4.0)]))
    assert (command.action, command.label) == ("stop_and_wait", "no_path")


def test_a_body_that_grazes_a_gap_steps_back_into_it():
    position = (3.75, 2.22)
    command, _ = decided_in(GAP, at_rest(position), position=position)
    assert command.reason.kind == "leaving_inflation"
    assert 0.0 < command.reason.distance_m <= 0.1
    assert command.trajectory.path[-1, 1] < position[1]


@pytest.mark.parametrize(("length_before", "turns"), [(5.5, False), (1.85, False), (1.0, True)])
def test_a_detour_with_room_to_turn_loses_to_a_narrow_way_that_is_none(length_before, turns):
    """A gap for the body straight ahead, 5.5 m, and a way of 5.9 m for the disc.

    Longer than twice the path before and 2 m more is a detour: 5.7 m and 4 m here. The first path
    is valid, and kept.
    """
    states = make_states(occupied=[(3.0, 3.5, 0.0, 1.7), (3.0, 3.5, 2.4, 2.5)])
    before = np.array([place(*START), place(START[0] + length_before, 2.05)])
    command, space = decided_in(states, at_rest(global_path=before))
    assert command.action in ("follow", "slow")
    assert space.turnable_along(command.global_path) is turns
