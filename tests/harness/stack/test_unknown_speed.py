"""Speed on a way through unknown space that is penalized: slow in it, not on the way to it."""

import numpy as np
import pytest

from tests.harness.stack.make_input import at_rest, make_input, make_states
from wayproof.harness.stack.decide import decide
from wayproof.harness.stack.types import BehaviourConfig
from wayproof.planners import stopping_distance

SHARE = BehaviourConfig().unknown_speed_fraction


def decided(unknown_from, **behaviour):
    """Decision of a robot at rest before space that is unknown from some x on, m."""
    states = make_states(unknown=[(unknown_from, 8.0, 0.0, 4.0)])
    settings = BehaviourConfig(**behaviour)
    input = make_input(states, policy="penalize", behaviour=settings)
    return input, decide(input, at_rest())[0]


def speeds_of(trajectory, known):
    """Speeds up to a length of the way and beyond it, m/s, to the end of a trajectory."""
    times = trajectory.start_ns + np.arange(0.0, trajectory.duration_s, 0.002) * 1e9
    samples = [trajectory.at(int(time)) for time in times]
    before = [one.speed for one in samples if one.arc_length < known - 1e-6]
    return np.array(before), np.array([one.speed for one in samples if one.arc_length >= known])


@pytest.mark.parametrize(("unknown_from", "action"), [(4.0, "follow"), (2.2, "slow")])
def test_a_robot_slows_down_where_the_unknown_begins(unknown_from, action):
    input, command = decided(unknown_from)
    known = command.reason.free_m
    assert (command.action, command.reason.kind) == (action, "slowing_for_unknown")
    before, beyond = speeds_of(command.trajectory, known)
    assert beyond.max() <= SHARE * input.gait.limits.speed + 1e-6
    assert beyond.max() > 0.95 * SHARE * input.gait.limits.speed
    assert command.trajectory.stop_point == pytest.approx(input.goal)
    if action == "follow":
        assert known > stopping_distance(input.gait.limits.speed, 0.0, input.gait.limits)
        assert before.max() == pytest.approx(input.gait.limits.speed)


def test_a_tiny_share_still_ends_at_the_goal():
    input, command = decided(4.0, unknown_speed_fraction=1e-6)
    known = command.reason.free_m
    _, beyond = speeds_of(command.trajectory, known)
    assert beyond.max() == pytest.approx(0.02, rel=0.01)
    assert command.trajectory.stop_point == pytest.approx(input.goal)


def test_a_way_that_is_known_costs_no_speed():
    input, command = decided(7.9)
    assert (command.action, command.reason.kind) == ("follow", "following")
    before, _ = speeds_of(command.trajectory, 1e9)
    assert before.max() == pytest.approx(input.gait.limits.speed)
