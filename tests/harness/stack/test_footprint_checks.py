import dataclasses
import math

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

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


def place(x: float, y: float = 2.0) -> np.ndarray:
    return np.array([x, y, 0.025])


def path(start: float, end: float) -> np.ndarray:
    return np.array([place(x) for x in np.linspace(start, end, 41)])


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
    assert first_misfit(lane, turn_in_place(place(3.0), 0, 0.0, math.pi, LIMITS)) == 0.0
    assert first_misfit(lane, turn_in_place(place(5.5), 0, 0.0, math.pi, LIMITS)) is None


def test_nose_first_where_it_can_turn_about_and_the_nearer_way_elsewhere(lane):
    wide, narrow = hold(place(5.5), 0, 0.1).at(0), hold(place(3.0), 0, 0.1).at(0)
    assert headings_to_start_at(lane, wide, math.pi) == [(math.pi, False)]
    assert headings_to_start_at(lane, narrow, math.pi) == [(2.0 * math.pi, True)]
    assert headings_to_start_at(lane, narrow, 0.0) == [(0.0, False)]
    assert headings_to_start_at(lane, narrow, math.pi / 2) == []


def test_tail_first_to_the_first_place_where_it_turns(lane):
    way = path(2.0, 6.5)
    end = truncate_where_turnable(lane, way, 0.0)[-1, 0]
    assert 4.0 < end < 4.8
    assert lane.turnable(np.array([place(end)]))[0]
    assert truncate_where_turnable(lane, way, 3.5)[-1, 0] == pytest.approx(5.5, abs=0.12)
    assert truncate_where_turnable(lane, path(2.0, 3.0), 0.0)[-1, 0] == 3.0
