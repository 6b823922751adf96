"""The learned reference stack, on hand-made observations."""

import numpy as np
import pytest

from tests.harness.interface.stacks.hand_made import observation, task
from wayproof.harness.interface.policy_tensors import PolicyObserver
from wayproof.harness.interface.stacks import STACKS
from wayproof.harness.interface.stacks.imitation import Imitation


@pytest.mark.parametrize(
    ("goal", "forward", "turn"),
    [
        ((0.8, 0.1), 0.5, 0.25),
        ((0.3, -0.5), 0.0, -1.0),
        ((-0.5, 0.1), 0.0, 1.0),
        ((0.05, 0.05), 0.0, 0.0),  # it rests
    ],
)
def test_the_last_metre_is_a_rule(goal, forward, turn):
    given = task(goal=goal)
    stack = STACKS["imitation"]()
    stack.start(given)
    motion = stack.step(observation(given)).motion
    assert motion.forward == pytest.approx(forward * given.mission.max_speed)
    assert motion.yaw_rate == pytest.approx(turn * given.mission.max_yaw_rate, abs=0.01)
    assert (motion.left, motion.up) == (0.0, 0.0)


def test_it_answers_alike_whenever_it_is_asked():
    given = task()
    tensors = PolicyObserver(given).tensors(observation(given, [(1.0, 0.2, 0.2)]))
    first, second = Imitation(), Imitation()
    assert all((first.act(tensors) == second.act(tensors)).all() for _ in range(3))


def test_what_it_sees_matters():
    given = task()
    observer, policy = PolicyObserver(given), Imitation()
    wall = [(0.8, y, 0.2) for y in np.linspace(-2.0, 2.0, 81)]
    actions = {
        tuple(policy.act(observer.tensors(observation(given, points, speed=0.5))).tolist())
        for points in ([], wall, [(x, 1.0, 0.2) for x in np.linspace(-2.0, 2.0, 81)])
    }
    assert len(actions) > 1
