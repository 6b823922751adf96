"""Stepping out of the inflation comes nearer neither to the unknown nor to an obstacle."""

import numpy as np
import pytest
from scipy.ndimage import distance_transform_edt

from harness.stack.behaviour import decide
from harness.stack.view import BehaviourConfig, Memory, View
from planners import FreeSpace, MotionLimits, PlannerConfig, hold

CELL, REACH = 0.1, 10  # m; cells that the field tells distances over
START = np.array([2.05, 3.05, 1.05])


def space(blocked):
    """6 x 6 x 2 m in which columns (60, 60) are blocked, for a ball of 0.3 m."""
    whole = np.repeat(blocked[:, :, None], 20, axis=2)
    squares = np.rint(distance_transform_edt(~whole) ** 2) if blocked.any() else whole + REACH**2
    field = np.minimum(squares, REACH**2).astype(np.uint16)
    return FreeSpace(field, np.zeros(3), CELL, 9, np.ones(REACH**2 + 1))


@pytest.mark.parametrize(("pillar", "action"), [(False, "recover"), (True, "stop_and_wait")])
def test_a_way_out_does_not_brush_an_obstacle(pillar, action):
    """It stands in a lane, a cell from what is unknown; the way out leads past the pillar."""
    unknown, obstacles = np.zeros((2, 60, 60), bool)
    unknown[:26, :30] = unknown[:26, 33:] = True
    obstacles[23, 31] = pillar
    admitted = space(unknown | obstacles)
    view = View(
        time_ns=0,
        effect_ns=0,
        sequence=0,
        seed=0,
        position=START,
        heading=0.0,
        goal=np.array([5.05, 3.05, 1.05]),
        goal_tolerance=0.2,
        admitted=admitted,
        known=admitted,
        passable=space(obstacles),
        turns_in_place=False,
        penalize_unknown=False,
        limits=MotionLimits(2.0, 2.5, 12.0, 2.5, 1.5),
        planner=PlannerConfig(),
        behaviour=BehaviourConfig(),
    )
    choice, _ = decide(view, Memory(hold(START, 0, 0.0)))
    assert (choice.action, choice.label) == (action, "start_blocked")
