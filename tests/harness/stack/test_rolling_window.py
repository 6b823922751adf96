"""The window that rolls along: where it lies, and when it moves."""

from dataclasses import replace

import numpy as np
import pytest

from wayproof.harness.config import Config
from wayproof.harness.config_document import override
from wayproof.harness.mission import Mission
from wayproof.harness.stack.rolling_window import INSET, RollingWindow, edge_of

EDGE = 32.0
MISSION = Mission(
    motion="ground",
    radius=0.4,
    height=0.5,
    step_height=0.03,
    max_speed=1.0,
    max_acceleration=2.0,
    max_jerk=10.0,
    max_yaw_rate=1.0,
    low=(0.0, 0.0, -0.5),
    high=(100.0, 20.0, 3.0),
    start=(5.0, 10.0, 0.3),
    start_heading=0.0,
    goal=(95.0, 10.0, 0.3),
)


def config_of(*settings):
    return override(Config("empty", "quadruped", 0), [f"costmap.window={EDGE:g}", *settings])


def moved_to(window, x, y=10.0):
    """Let the robot stand somewhere; return whether the window moves."""
    centre = window.centred_on(np.array([x, y, 0.3]))
    moves = window.leaves_behind(centre)
    if moves:
        window.move(centre)
    return moves


def along_x(corners):
    return [float(corner[0]) for corner in corners]


def test_only_an_area_half_as_long_again_as_the_window_is_not_held_whole():
    small = replace(MISSION, high=(48.0, 20.0, 3.0), goal=(40.0, 10.0, 0.3))
    assert edge_of(config_of(), MISSION) == EDGE
    for settings, mission in (
        ((), small),
        (("costmap.window=0",), MISSION),
        (("costmap.max_slope=0.3",), MISSION),
    ):
        window = RollingWindow(config_of(*settings), mission)
        np.testing.assert_array_equal(window.corners, [mission.low, mission.high])
        assert not moved_to(window, 40.0)
        window.move((0, 0))
        np.testing.assert_array_equal(window.inner, [mission.low[:2], mission.high[:2]])


def test_it_begins_at_the_start_and_stays_within_the_area():
    window = RollingWindow(config_of(), MISSION)
    low, high = window.corners
    np.testing.assert_allclose(low, [0.0, 0.0, -0.5])
    np.testing.assert_allclose(high, [EDGE, 20.0, 3.0])  # as wide as the area, which is narrower


def test_it_moves_once_the_robot_is_an_eighth_of_an_edge_from_its_centre():
    window = RollingWindow(config_of(), MISSION)
    assert not moved_to(window, 15.9)  # centred as near as the area's end allows
    assert not moved_to(window, 19.9)
    assert moved_to(window, 20.2)
    assert along_x(window.corners) == pytest.approx([4.2, 36.2])
    assert not moved_to(window, 16.3)
    assert not moved_to(window, 24.1)
    assert moved_to(window, 24.4)


def test_it_reaches_the_end_of_the_area_as_soon_as_the_robot_is_near():
    window = RollingWindow(config_of(), MISSION)
    moved_to(window, 82.0)
    assert along_x(window.corners) == pytest.approx([66.0, 98.0])
    assert moved_to(window, 84.5)  # less than an eighth on
    assert along_x(window.corners) == pytest.approx([68.0, 100.0])
    assert not moved_to(window, 83.9)  # and does not go to and fro
    assert not moved_to(window, 84.1)


def test_a_goal_keeps_away_from_the_borders_that_the_area_goes_on_beyond():
    window = RollingWindow(config_of(), MISSION)
    low, high = window.inner
    np.testing.assert_allclose(low, [0.0, 0.0])
    np.testing.assert_allclose(high, [EDGE - INSET, 20.0])
    moved_to(window, 50.0)
    assert along_x(window.inner) == pytest.approx([34.0 + INSET, 66.0 - INSET])


def test_an_edge_too_short_for_sensors_and_stops_is_refused():
    with pytest.raises(Exception, match=r"costmap.window: got 10, expected 0 or 24 to 10000 m"):
        config_of("costmap.window=10")


@pytest.mark.parametrize("beyond", [0.0, 0.03, 0.05, 0.07, 0.1])
def test_a_goal_at_the_border_is_in_the_last_window_whatever_the_extent(beyond):
    wide = replace(MISSION, low=(-beyond, 0.0, -0.5), high=(100.0 + beyond, 20.0, 3.0))
    window = RollingWindow(config_of(), wide)
    assert along_x(window.inner) == pytest.approx([-beyond, EDGE - INSET], abs=0.2)
    assert window.inner[0][0] == -beyond
    moved_to(window, 99.0)
    assert window.inner[1][0] == 100.0 + beyond
