"""Tensors of a policy: its observation and its action.

Belief alone, float32, of fixed shapes, so that one definition serves the inputs of an ONNX file and
the observation space of Gymnasium. Built with sums, products, quotients and square roots, which
every processor rounds alike.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.geometry import yaw_of_quaternion
from wayproof.harness.interface.types import Array, Observation, Task, Velocity
from wayproof.harness.mission import Mission
from wayproof.maps.elementary import sines_cosines

Tensor = NDArray[np.float32]

BEARINGS = 72
"""Number of bearings of the scan, each 5 degrees wide."""

SCAN_RANGE_M = 10.0
"""Range of a bearing of the scan without a return that is nearer, m."""

FLOOR_NOISE_M = 0.01
"""Height above what the body steps over below which a return counts as floor, m."""

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
        angles = np.arange(BEARINGS, dtype=np.float64) * (2.0 * math.pi / BEARINGS)
        sines, cosines = sines_cosines(angles)
        self._edges = _pseudo_angles(cosines, sines)

    def tensors(self, observation: Observation) -> dict[str, Tensor]:
        """Return the tensors of `OBSERVATION`, without a batch."""
        heading = yaw_of_quaternion(observation.quaternion)
        reference = observation.reference
        values = {
            "scan": self._scan(observation, heading),
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

    def _scan(self, observation: Observation, heading: float) -> Array:
        """Return the distance (BEARINGS,) of the nearest return by bearing, m."""
        points = np.vstack([sweep.points for sweep in observation.sweeps] or [np.zeros((0, 3))])
        low, high = self._heights(float(observation.position[2]))
        points = points[(points[:, 2] > low) & (points[:, 2] < high)]
        offsets = in_body(points - observation.position, heading)
        x, y = offsets[:, 0], offsets[:, 1]
        distances = np.sqrt(x * x + y * y)
        near = (distances < SCAN_RANGE_M) & (distances > 0.0)
        angles = _pseudo_angles(x[near], y[near])
        bearings = np.searchsorted(self._edges, angles, side="right") - 1
        scan = np.full(BEARINGS, SCAN_RANGE_M)
        np.minimum.at(scan, bearings, distances[near])
        return scan

    def _heights(self, height: float) -> tuple[float, float]:
        """Return heights between which a return is in the body's way, world frame, m."""
        mission = self._mission
        if not mission.planar:
            return height - mission.radius, height + mission.radius
        floor = height - mission.start[2] + FLOOR_NOISE_M
        return floor + mission.step_height, floor + mission.height


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


def in_body(vectors: Array, heading: float) -> Array:
    """Return vectors (..., 3) of the world in the body's frame, by its heading alone."""
    sines, cosines = sines_cosines(np.array([heading]))
    sine, cosine = float(sines[0]), float(cosines[0])
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, z], axis=-1)


def in_world(vectors: Array, heading: float) -> Array:
    """Return vectors (..., 3) of the body's frame in the world; the inverse of `in_body`."""
    return in_body(vectors, -heading)


def _pseudo_angles(x: Array, y: Array) -> Array:
    """Return numbers (n,) in [0, 4) that grow with the angle of (x, y) from the x axis.

    Their order is that of the angles, and they need no arc tangent.
    """
    share = x / (np.abs(x) + np.abs(y))
    angles: Array = np.where(y >= 0.0, 1.0 - share, 3.0 + share)
    return angles
