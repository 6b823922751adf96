"""Tensors of a policy: its observation and its action.

Belief alone, float32, of fixed shapes, so that one definition serves the inputs of an ONNX file and
the observation space of Gymnasium. Built with sums, products, quotients and square roots, which
every processor rounds alike.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.geometry import yaw_of_quaternion
from wayproof.harness.interface.returns import in_body, scan
from wayproof.harness.interface.types import Observation, Task, Velocity
from wayproof.harness.mission import Mission

Tensor = NDArray[np.float32]

BEARINGS = 72
"""Number of bearings of the scan, each 5 degrees wide."""

SCAN_RANGE_M = 10.0
"""Range of a bearing of the scan without a return that is nearer, m."""

STILL = 0.05
"""Share of a limit below which a component of an action is zero, so that a body can rest."""

HOLD_S = 0.3
"""Time for which a velocity holds, s."""


class Space(NamedTuple):
    """Shape and bounds of one tensor.

    Attributes:
        shape: Shape without the batch.
        low: Least value; lower ones are clipped to it.
        high: Greatest one.
    """

    shape: tuple[int, ...]
    low: float
    high: float


OBSERVATION: dict[str, Space] = {
    "scan": Space((BEARINGS,), 0.0, SCAN_RANGE_M),
    "goal": Space((3,), -100.0, 100.0),
    "velocity": Space((4,), -20.0, 20.0),
    "reference": Space((4,), -20.0, 20.0),
    "sigma": Space((2,), 0.0, 100.0),
}
"""Tensors that a policy observes, by name, in the body's frame: x forward, y left, z up, level.

scan: Horizontal distance of the nearest return at a height that the body takes, m; bearing `k` is
    `[5 k, 5 k + 5)` degrees counter-clockwise from straight ahead.
goal: Offset of the goal, m.
velocity: Estimated velocity forward, left and up, m/s, and yaw rate, rad/s.
reference: The commanded ones at the time when the action takes effect.
sigma: Standard deviation of the position, m, and of the heading, rad.
"""

ACTION = Space((4,), -1.0, 1.0)
"""Velocity forward, left and up as shares of the greatest speed, and yaw rate of the greatest."""


class PolicyObserver:
    """Turns the observations of one task into tensors."""

    def __init__(self, task: Task) -> None:
        """Take the body and the goal of a task."""
        self._mission = task.mission

    def tensors(self, observation: Observation) -> dict[str, Tensor]:
        """Return the tensors of `OBSERVATION`, without a batch."""
        heading = yaw_of_quaternion(observation.quaternion)
        reference = observation.reference
        values = {
            "scan": scan(observation, self._mission, bearings=BEARINGS, reach_m=SCAN_RANGE_M),
            "goal": in_body(observation.goal - observation.position, heading),
            "velocity": np.append(in_body(observation.velocity, heading), observation.yaw_rate),
            "reference": np.append(
                in_body(reference.velocity, reference.heading), reference.yaw_rate
            ),
            "sigma": np.array([observation.position_sigma, observation.heading_sigma]),
        }
        return {
            name: np.clip(values[name], space.low, space.high).astype(np.float32)
            for name, space in OBSERVATION.items()
        }


def velocity_of(action: NDArray[np.floating], mission: Mission) -> Velocity:
    """Return the velocity that an action (4,) of `ACTION` stands for.

    Components beyond -1 and 1 are clipped, those below `STILL` are zero. One that is not finite
    stays so, and the referee refuses it.
    """
    shares = np.clip(action.astype(np.float64), ACTION.low, ACTION.high)
    forward, left, up, turn = np.where(np.abs(shares) < STILL, 0.0, shares).tolist()
    speed = mission.max_speed
    up = 0.0 if mission.planar else up
    return Velocity(
        forward * speed,
        left=left * speed,
        up=up * speed,
        yaw_rate=turn * mission.max_yaw_rate,
        duration_s=HOLD_S,
    )
