"""Dynamic window approach: on hand-made observations, and in short episodes."""

import math
from pathlib import Path

import numpy as np
import pytest

from tests.harness.interface.stacks.hand_made import observation, ring, started, task, wall
from wayproof import Config, build, open_log, override, run_episode
from wayproof.harness.interface.command_messages import command_message
from wayproof.harness.interface.stacks.dwa import (
    CELL_M,
    CELLS,
    DECAY_S,
    Dwa,
    LocalGrid,
    NavigationFunction,
)

ROBOTS = ["quadruped", "drone"]
NOWHERE = np.zeros((0, 3))


def velocity(task, *arguments, **keywords):
    return started(Dwa, task).step(observation(task, *arguments, **keywords)).motion


@pytest.mark.parametrize("robot", ROBOTS)
def test_in_the_open_it_speeds_up_towards_the_goal(robot):
    ahead = velocity(task(robot))
    assert ahead.forward > 0.3
    assert abs(ahead.left) < 0.1  # the base is on a cell's corner, the path on cells' centres
    assert abs(ahead.yaw_rate) < 0.15
    slow, fast = (velocity(task(robot), speed=speed).forward for speed in (0.0, 0.5))
    limit = 1.5 * 0.3  # acceleration times the time of the window
    assert slow == pytest.approx(limit, abs=0.02)
    assert fast == pytest.approx(0.5 + limit, abs=0.02)


def test_it_steers_around_an_obstacle_ahead_on_the_open_side():
    free = task()
    for side in (1.0, -1.0):
        points = wall(free, (1.2, -2.0 * side), (1.2, 0.3 * side))
        steered = velocity(free, points, speed=0.5)
        assert side * steered.yaw_rate > 0.1


def test_a_drone_flies_around_an_obstacle_ahead_on_the_open_side():
    free = task("drone")
    for side in (1.0, -1.0):
        steered = velocity(free, wall(free, (1.2, -2.0 * side), (1.2, 0.3 * side)), speed=0.2)
        assert side * steered.left > 0.1
        assert side * steered.yaw_rate > 0.1


def test_no_velocity_is_chosen_that_it_cannot_brake_from():
    """A wall all across, 0.9 m ahead of the centre: 0.48 m from the foremost disc."""
    blocked = task()
    chosen = velocity(blocked, wall(blocked, (0.9, -4.5), (0.9, 4.5)), speed=0.3)
    room = 0.9 - 0.48 - 0.2 + CELL_M
    assert chosen.forward * 0.3 + chosen.forward**2 / (2.0 * 1.5) <= room
    assert velocity(blocked, speed=0.3).forward > chosen.forward


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_turns_to_a_goal_behind(robot, side):
    turned = velocity(task(robot, goal=(-4.0, 0.5 * side)))
    assert side * turned.yaw_rate > 0.3
    assert turned.forward < 0.1


@pytest.mark.parametrize("robot", ROBOTS)
def test_closed_in_it_stops_and_rotates(robot):
    closed = task(robot)
    stack, points = started(Dwa, closed), ring(closed, 0.5)
    commands = [stack.step(observation(closed, points, n)) for n in range(30)]
    for command in commands:
        motion = command.motion
        assert (motion.forward, motion.left) == (0.0, 0.0)
        assert abs(motion.yaw_rate) == 0.5
        assert command.scalars["recovering"] == 1.0
    assert len({command.motion.yaw_rate for command in commands}) == 1


def test_at_the_goal_it_stands():
    arrived = velocity(task(goal=(0.1, 0.0)))
    assert (arrived.forward, arrived.left, arrived.yaw_rate) == (0.0, 0.0, 0.0)


def test_returns_of_the_floor_and_from_above_are_no_obstacles():
    free = task()
    line = wall(free, (0.8, -3.0), (0.8, 3.0))
    for height in (0.02, 1.5):
        line[:, 2] = height
        assert velocity(free, line) == velocity(free)
    line[:, 2] = 0.3
    assert velocity(free, line) != velocity(free)


def test_the_same_observations_give_the_same_commands():
    free = task()
    points = wall(free, (1.0, -2.0), (1.5, 0.2))
    first, second = (started(Dwa, free) for _ in range(2))
    for n in range(5):
        seen = observation(free, points, n, speed=0.1 * n)
        one, other = (command_message(stack.step(seen), n) for stack in (first, second))
        assert one == other


def test_it_plans_around_what_it_sees_and_says_so():
    free = task()
    line = wall(free, (1.5, -1.0), (1.5, 1.0))
    start, goal = np.array(free.mission.start), np.array(free.mission.goal)
    path = started(Dwa, free).step(observation(free, line)).planned_path
    assert path[-1] == pytest.approx([goal[0], goal[1], start[2]])
    assert np.linalg.norm(path[0] - start) < CELL_M
    gaps = np.linalg.norm(path[:, None, :2] - line[None, :, :2], axis=2)
    assert gaps.min() > 0.3


def test_a_return_is_forgotten_after_its_time_and_outside_of_the_window():
    grid, origin = LocalGrid(), np.zeros(3)
    point = np.array([[1.05, 0.55, 0.3]])
    around = grid.update(origin, point, 0.0)
    assert around.distances_at(point[:, :2])[0] == pytest.approx(0.0, abs=1e-9)
    assert around.distances_at(np.array([[2.05, 0.55]]))[0] == pytest.approx(1.0)
    around = grid.update(origin, NOWHERE, DECAY_S - 0.1)
    assert around.distances_at(point[:, :2])[0] == pytest.approx(0.0, abs=1e-9)
    assert grid.update(origin, NOWHERE, DECAY_S).distances.min() > CELLS * CELL_M / 2
    grid.update(origin, point, DECAY_S)
    grid.update(np.array([50.0, 0.0, 0.0]), NOWHERE, DECAY_S)
    assert grid.update(origin, NOWHERE, DECAY_S).distances.min() > CELLS * CELL_M / 2


def test_the_navigation_function_leads_around_a_wall():
    free = task()
    grid = LocalGrid()
    line = wall(free, (1.0, -4.9), (1.0, 1.0))
    around = grid.update(np.zeros(3), line, 0.0)
    open_around = LocalGrid().update(np.zeros(3), NOWHERE, 0.0)
    function, goal = NavigationFunction(0.2), np.array([3.05, 0.05])
    i, j = around.cells(np.zeros(2)).tolist()
    cost, straight = (
        function.solve(one, goal, 0.1)[0][i * CELLS + j] for one in (around, open_around)
    )
    over = math.hypot(1.0, 1.3) + math.hypot(2.0, 1.3)  # around the wall's end, 0.3 m off
    assert straight == pytest.approx(3.05, abs=0.1)
    assert over < cost < 2.0 * over


@pytest.mark.few(1)
def test_an_episode_reaches_the_goal_without_a_collision(tmp_path):
    config = override(Config("cylinders", "quadruped", 2), ["stack.name=dwa", "record=decisions"])
    result = run_episode(build(config), tmp_path / "a.mcap")
    assert (result.outcome, result.collisions) == ("success", 0)
    verdicts = [one.verdict.verdict for one in open_log(Path(result.log)).decisions()]
    assert verdicts.count("admitted") > 0.5 * len(verdicts)
