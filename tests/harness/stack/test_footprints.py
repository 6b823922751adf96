"""Where an elongated body fits at its heading, and when it is planned as its disc."""

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
)
from wayproof.harness.stack.footprint_checks import (
    first_misfit,
    headings_to_start_at,
    truncate_where_turnable,
)
from wayproof.harness.stack.footprint_mode import MAX_STEP, decide_with_footprint
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


DISC = Body((0.0,), (LONG.circumscribed_radius,))
"""The disc about the long body."""

GAP = make_states(occupied=[(3.0, 4.5, 0.0, 1.7), (3.0, 4.5, 2.4, 4.0)])
"""A gap of 0.7 m between start and goal: the disc of 1 m does not fit, the body of 0.4 m does."""


class Oriented:
    """Makes the input of the oriented footprint, and counts how often."""

    def __init__(self, **room):
        self.calls, self._room = 0, room

    def __call__(self):
        self.calls += 1
        return make_input(body=LONG, **self._room)


def decide_in(states=None, state=None, **room):
    """The decision in a room, and how often the oriented input was made."""
    oriented = Oriented(states=states, **room)
    circumscribed = make_input(states, DISC, **room)
    decided = decide_with_footprint(circumscribed, oriented, state or at_rest())
    assert decided.input.traversable.discs == (
        make_input(states, LONG).traversable.discs if decided.state.narrows.oriented else ()
    )
    return decided, oriented.calls


def test_a_gap_too_narrow_for_the_disc_is_taken_at_the_heading():
    decided, calls = decide_in(GAP)
    assert decided.state.narrows.oriented
    assert calls == 1
    assert decided.command.action == "follow"
    assert decided.command.global_path[-1] == pytest.approx(place(*GOAL))
    inside = np.abs(decided.command.global_path[:, 0] - 3.75) < 0.75
    assert inside.any()
    assert np.abs(decided.command.global_path[inside, 1] - 2.05).max() < 0.2


def test_where_neither_footprint_leads_on_the_decision_is_that_of_the_disc():
    wall = make_states(occupied=[(3.0, 4.5, 0.0, 4.0)])
    decided, calls = decide_in(wall)
    assert calls == 1
    assert not decided.state.narrows.oriented
    assert (decided.command.action, decided.command.label) == ("stop_and_wait", "no_path")


def in_gap(heading=0.0, **state):
    """A long body inside the gap on its way to the goal, and the room about it."""
    position = (3.75, 2.05)
    path = np.array([place(*position), place(*GOAL)])
    return at_rest(position, heading, global_path=path, oriented=True, **state), {
        "position": position,
        "heading": heading,
    }


def test_the_oriented_footprint_is_kept_where_the_rest_of_the_path_is_too_narrow():
    state, room = in_gap()
    decided, calls = decide_in(GAP, state, **room)
    assert decided.state.narrows.oriented
    assert calls == 1


@pytest.mark.parametrize(("aside", "oriented"), [(0.17, True), (0.27, False)])
def test_a_body_that_grazes_a_gap_steps_back_into_it_where_its_disc_has_no_way_out(aside, oriented):
    position = (3.75, 2.05 + aside)
    decided, calls = decide_in(GAP, at_rest(position, oriented=True), position=position)
    assert calls == 1
    assert decided.state.narrows.oriented is oriented
    reason = decided.command.reason
    assert reason.kind == "leaving_inflation"
    assert (reason.distance_m is not None) is oriented
    if oriented:
        assert 0.0 < reason.distance_m <= MAX_STEP
        assert decided.command.trajectory.path[-1, 1] < position[1]


def test_the_disc_does_not_return_while_the_body_moves_tail_first():
    position = (5.3, 2.05)
    path = np.array([place(*position), place(*GOAL)])
    for heading, oriented in ((0.0, False), (np.pi, True)):
        state = at_rest(position, heading, global_path=path, oriented=True)
        decided, _ = decide_in(GAP, state, position=position, heading=heading)
        assert decided.state.narrows.oriented is oriented


@pytest.mark.parametrize(
    ("length_before", "oriented", "calls"), [(5.5, False, 0), (1.85, True, 1), (1.0, False, 1)]
)
def test_a_detour_of_the_disc_loses_to_the_oriented_footprint_that_makes_none(
    length_before, oriented, calls
):
    """A gap for the body straight ahead, 5.5 m, and a way of 5.9 m for the disc.

    Longer than twice the path before and 2 m more is a detour: 13 m, 5.7 m and 4 m here.
    """
    states = make_states(occupied=[(3.0, 3.5, 0.0, 1.7), (3.0, 3.5, 2.4, 2.5)])
    before = np.array([place(*START), place(START[0] + length_before, 2.05)])
    decided, made = decide_in(states, at_rest(global_path=before))
    assert decided.command.action in ("follow", "slow")
    assert (decided.state.narrows.oriented, made) == (oriented, calls)
