"""The stacks that Wayproof brings, on hand-made observations, and whole episodes of two of them."""

import math

import numpy as np
import pytest

from tests.harness.interface.stacks.hand_made import observation, ring, started, task, wall
from wayproof.harness.interface.policy_tensors import PolicyObserver
from wayproof.harness.interface.stacks.blind import Blind
from wayproof.harness.interface.stacks.dwa import (
    CELL_M,
    CELLS,
    DECAY_S,
    Dwa,
    LocalGrid,
    NavigationFunction,
)
from wayproof.harness.interface.stacks.gap import AHEAD_S, MARGIN_M, REACH_M, Gap
from wayproof.harness.interface.stacks.imitation import Imitation

ROBOTS = ["quadruped", "drone"]
NOWHERE = np.zeros((0, 3))


def velocity(kind, task, *arguments, **keywords):
    return started(kind, task).step(observation(task, *arguments, **keywords)).motion


@pytest.mark.parametrize("robot", ROBOTS)
def test_in_the_open_each_drives_at_the_goal(robot):
    free = task(robot)
    most = free.mission.max_speed
    ahead = velocity(Blind, free)
    assert (ahead.forward, ahead.left, ahead.yaw_rate) == (most, 0.0, 0.0)
    assert velocity(Blind, free, wall(free, (1.0, -2.0), (1.0, 2.0))) == ahead  # through a wall
    ahead = velocity(Gap, free)
    assert ahead.forward == most
    assert abs(ahead.yaw_rate) < 0.05
    ahead = velocity(Dwa, free)
    assert abs(ahead.left) < 0.1  # the base is on a cell's corner, the path on cells' centres
    assert abs(ahead.yaw_rate) < 0.15
    limit = 1.5 * 0.3  # acceleration times the time of the window
    assert ahead.forward == pytest.approx(limit, abs=0.02)
    assert velocity(Dwa, free, speed=0.5).forward == pytest.approx(0.5 + limit, abs=0.02)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(
    ("kind", "robot", "x", "least", "speed"),
    [
        (Gap, "quadruped", 2.0, 0.3, 0.0),
        (Gap, "drone", 2.0, 0.3, 0.0),
        (Dwa, "quadruped", 1.2, 0.1, 0.5),
        (Dwa, "drone", 1.2, 0.1, 0.2),
    ],
)
def test_it_steers_to_the_open_side_of_an_obstacle_ahead(kind, robot, x, least, speed, side):
    free = task(robot)
    points = wall(free, (x, -2.0 * side), (x, 0.3 * side))
    steered = velocity(kind, free, points, speed=speed)
    assert side * steered.yaw_rate > least
    assert (kind, robot) != (Dwa, "drone") or side * steered.left > 0.1


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(
    ("kind", "robot", "least"), [(Gap, "quadruped", 1.0), *((Dwa, robot, 0.3) for robot in ROBOTS)]
)
def test_it_turns_to_a_goal_behind(kind, robot, least, side):
    turned = velocity(kind, task(robot, goal=(-4.0, 0.5 * side)))
    assert side * turned.yaw_rate >= least
    assert turned.forward < 0.1


def test_one_that_walks_blindly_turns_first_and_one_that_flies_goes_sideways():
    turned = velocity(Blind, task(goal=(0.0, 4.0)))
    assert (turned.forward, turned.left, turned.yaw_rate) == (0.0, 0.0, 1.0)
    flown = velocity(Blind, task("drone", goal=(0.0, 4.0)))
    assert flown.left == pytest.approx(2.0)
    assert flown.forward == pytest.approx(0.0, abs=1e-9)
    assert velocity(Blind, task(goal=(0.5, 0.0))).forward == pytest.approx(0.5)  # it slows down


@pytest.mark.parametrize("kind", [Blind, Gap, Dwa])
def test_at_the_goal_it_stands(kind):
    arrived = velocity(kind, task(goal=(0.1, 0.0)))
    assert (arrived.forward, arrived.left, arrived.yaw_rate) == (0.0, 0.0, 0.0)


def test_the_speed_between_gaps_follows_the_room_ahead():
    closed = task()
    room = 1.2 - 0.45 - MARGIN_M
    found = [velocity(Gap, closed, ring(closed, r)).forward for r in (1.2, 0.5, REACH_M + 0.5)]
    assert found == pytest.approx([room / AHEAD_S, 0.0, 1.0], abs=0.01)


def test_it_keeps_its_course_between_two_gaps_alike():
    """The wall's ends are 1 m to either side; the left one, first by a little, stays chosen."""
    free = task()
    stack = started(Gap, free)
    first = stack.step(observation(free, wall(free, (1.5, -1.2), (1.5, 1.0)))).motion
    mirrored = observation(free, wall(free, (1.5, -1.0), (1.5, 1.2)), sequence=1)
    assert first.yaw_rate > 0.3
    assert stack.step(mirrored).motion.yaw_rate > 0.3
    assert started(Gap, free).step(mirrored).motion.yaw_rate < -0.3


def test_no_velocity_is_chosen_that_it_cannot_brake_from():
    """A wall all across, 0.9 m ahead of the centre: 0.48 m from the foremost disc."""
    blocked = task()
    chosen = velocity(Dwa, blocked, wall(blocked, (0.9, -4.5), (0.9, 4.5)), speed=0.3)
    room = 0.9 - 0.48 - 0.2 + CELL_M
    assert chosen.forward * 0.3 + chosen.forward**2 / (2.0 * 1.5) <= room
    assert velocity(Dwa, blocked, speed=0.3).forward > chosen.forward


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


def test_returns_of_the_floor_and_from_above_are_no_obstacles():
    free = task()
    line = wall(free, (0.8, -3.0), (0.8, 3.0))
    for height, seen in ((0.02, False), (1.5, False), (0.3, True)):
        line[:, 2] = height
        assert (velocity(Dwa, free, line) != velocity(Dwa, free)) == seen


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
    around = LocalGrid().update(np.zeros(3), wall(free, (1.0, -4.9), (1.0, 1.0)), 0.0)
    open_around = LocalGrid().update(np.zeros(3), NOWHERE, 0.0)
    function, goal = NavigationFunction(0.2), np.array([3.05, 0.05])
    i, j = around.cells(np.zeros(2)).tolist()
    cost, straight = (
        function.solve(one, goal, 0.1)[0][i * CELLS + j] for one in (around, open_around)
    )
    over = math.hypot(1.0, 1.3) + math.hypot(2.0, 1.3)  # around the wall's end, 0.3 m off
    assert straight == pytest.approx(3.05, abs=0.1)
    assert over < cost < 2.0 * over


@pytest.mark.parametrize(
    ("goal", "forward", "turn"),
    [
        ((0.8, 0.1), 0.5, 0.25),
        ((0.3, -0.5), 0.0, -1.0),
        ((-0.5, 0.1), 0.0, 1.0),
        ((0.05, 0.05), 0.0, 0.0),  # it rests
    ],
)
def test_the_last_metre_of_the_learned_stack_is_a_rule(goal, forward, turn):
    given = task(goal=goal)
    motion = velocity(Imitation, given)
    assert motion.forward == pytest.approx(forward * given.mission.max_speed)
    assert motion.yaw_rate == pytest.approx(turn * given.mission.max_yaw_rate, abs=0.01)
    assert (motion.left, motion.up) == (0.0, 0.0)


def test_what_the_learned_stack_sees_matters_and_it_answers_alike_whenever_it_is_asked():
    given = task()
    observer, policy = PolicyObserver(given), Imitation()
    line = np.linspace(-2.0, 2.0, 81)
    answers = set()
    for points in ([], [(0.8, y, 0.2) for y in line], [(x, 1.0, 0.2) for x in line]):
        tensors = observer.tensors(observation(given, points, speed=0.5))
        own = {tuple(one.act(tensors).tolist()) for one in (policy, policy, Imitation())}
        assert len(own) == 1
        answers |= own
    assert len(answers) > 1
