"""The blind stack: straight at the goal, whatever stands there."""

import pytest

from tests.harness.interface.stacks.hand_made import observation, started, task, wall
from wayproof.harness.interface.stacks.blind import Blind


def velocity(task, *arguments):
    return started(Blind, task).step(observation(task, *arguments)).motion


@pytest.mark.parametrize("robot", ["quadruped", "drone"])
def test_it_drives_at_the_goal_through_a_wall(robot):
    free = task(robot)
    ahead = velocity(free, wall(free, (1.0, -2.0), (1.0, 2.0)))
    assert ahead == velocity(free)
    assert ahead.forward == free.mission.max_speed
    assert ahead.left == ahead.yaw_rate == 0.0


def test_one_that_walks_turns_first_and_one_that_flies_goes_sideways():
    turned = velocity(task(goal=(0.0, 4.0)))
    assert (turned.forward, turned.left, turned.yaw_rate) == (0.0, 0.0, 1.0)
    flown = velocity(task("drone", goal=(0.0, 4.0)))
    assert flown.left == pytest.approx(2.0)
    assert flown.forward == pytest.approx(0.0, abs=1e-9)


def test_it_slows_down_near_the_goal_and_stands_there():
    assert velocity(task(goal=(0.5, 0.0))).forward == pytest.approx(0.5)
    assert velocity(task(goal=(0.1, 0.0))).forward == 0.0
