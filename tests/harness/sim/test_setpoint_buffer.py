"""The buffer of setpoints between two decisions."""

import numpy as np
import pytest

from wayproof.harness.sim.setpoint_buffer import SetpointBuffer
from wayproof.planners import MotionLimits, PathState, follow_path, hold

STEP_NS = 2_000_000
LIMITS = MotionLimits(1.0, 1.0, 10.0, 1.0, 1.0)


@pytest.fixture
def driven():
    path = np.array([[0.0, 0.0, 0.5], [2.0, 0.0, 0.5]])
    return follow_path(path, PathState(0, 0.0, 0.0, 0.0, 0.0), LIMITS, 1.0)


def take(buffer):
    """Take the next setpoint, as the simulation does: its row is written first."""
    buffer.commanded[buffer.row] = buffer.planned[buffer.row]
    return buffer.next()


def test_an_empty_buffer_holds_nothing(driven):
    buffer = SetpointBuffer(STEP_NS, 5)
    assert not buffer.holds(driven, 0)
    assert buffer.drain_setpoints() == b""


def test_setpoints_are_those_of_the_trajectory_at_each_step(driven):
    buffer = SetpointBuffer(STEP_NS, 5)
    begin = 300_000_000
    buffer.sample(driven, begin)
    for step in range(5):
        assert buffer.holds(driven, begin + step * STEP_NS)
        sample = driven.at(begin + step * STEP_NS)
        np.testing.assert_allclose(take(buffer).position, sample.position, rtol=1e-12)
    assert not buffer.holds(driven, begin + 5 * STEP_NS)  # sampled to its end


def test_another_trajectory_or_another_time_has_to_be_sampled(driven):
    buffer = SetpointBuffer(STEP_NS, 5)
    buffer.sample(driven, 0)
    assert not buffer.holds(hold(np.zeros(3), 0, 0.0), 0)
    assert not buffer.holds(driven, STEP_NS)
    take(buffer)
    assert buffer.holds(driven, STEP_NS)
    assert not buffer.holds(driven, 0)


def test_every_setpoint_taken_is_drained_once_in_order(driven):
    buffer = SetpointBuffer(STEP_NS, 5)
    buffer.sample(driven, 0)
    rows = [take(buffer).row for _ in range(3)]
    buffer.sample(driven, 3 * STEP_NS)  # what was not taken of the first sample is dropped
    rows += [take(buffer).row for _ in range(2)]
    assert buffer.drain_setpoints() == np.array(rows).tobytes()
    assert buffer.drain_setpoints() == b""
    rows = [take(buffer).row]
    assert buffer.drain_setpoints() == np.array(rows).tobytes()
