"""Follow the gap: on hand-made observations, and in short episodes."""

import pytest

from tests.harness.interface.stacks.hand_made import observation, ring, started, task, wall
from wayproof import Config, build, override, run_episode
from wayproof.harness.interface.stacks.gap import AHEAD_S, MARGIN_M, REACH_M, Gap

ROBOTS = ["quadruped", "drone"]


def velocity(task, *arguments, **keywords):
    return started(Gap, task).step(observation(task, *arguments, **keywords)).motion


@pytest.mark.parametrize("robot", ROBOTS)
def test_in_the_open_it_drives_at_the_goal_at_full_speed(robot):
    ahead = velocity(task(robot))
    assert ahead.forward == (1.0 if robot == "quadruped" else 2.0)
    assert abs(ahead.yaw_rate) < 0.05


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_steers_to_the_open_side_of_an_obstacle_ahead(robot, side):
    free = task(robot)
    steered = velocity(free, wall(free, (2.0, -2.0 * side), (2.0, 0.3 * side)))
    assert side * steered.yaw_rate > 0.3


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_turns_on_the_spot_to_a_goal_behind(side):
    turned = velocity(task(goal=(-4.0, 0.5 * side)))
    assert turned.forward == 0.0
    assert side * turned.yaw_rate == 1.0


def test_its_speed_follows_the_room_ahead():
    closed = task()
    room = 1.2 - 0.45 - MARGIN_M
    assert velocity(closed, ring(closed, 1.2)).forward == pytest.approx(room / AHEAD_S, abs=0.01)
    assert velocity(closed, ring(closed, 0.5)).forward == 0.0
    assert velocity(closed, ring(closed, REACH_M + 0.5)).forward == 1.0


def test_it_keeps_its_course_between_two_gaps_alike():
    """The wall's ends are 1 m to either side; the left one, first by a little, stays chosen."""
    free = task()
    stack = started(Gap, free)
    first = stack.step(observation(free, wall(free, (1.5, -1.2), (1.5, 1.0)))).motion
    mirrored = observation(free, wall(free, (1.5, -1.0), (1.5, 1.2)), sequence=1)
    assert first.yaw_rate > 0.3
    assert stack.step(mirrored).motion.yaw_rate > 0.3
    assert started(Gap, free).step(mirrored).motion.yaw_rate < -0.3


def test_at_the_goal_it_stands():
    assert velocity(task(goal=(0.1, 0.0))).forward == 0.0


@pytest.mark.few(1)
def test_an_episode_reaches_the_goal_without_a_collision(tmp_path):
    config = override(Config("cylinders", "drone", 2), ["stack.name=gap", "record=decisions"])
    result = run_episode(build(config), tmp_path / "a.mcap")
    assert (result.outcome, result.collisions) == ("success", 0)
