"""Pose estimate of the simulated body, from the simulator's truth and the odometry's errors.

The stack gets each estimate as it is, controllers get it smoothed: see `models.step_kernels`.
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.geometry import yaw_of_quaternion
from wayproof.harness.perturbations import UNPERTURBED
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.odometry import Odometry, PoseError, estimated_trail
from wayproof.models.poses import Trail

Array = NDArray[np.float64]


class PoseEstimate:
    """The estimated pose of one body.

    Attributes:
        error: Estimated minus true pose, of the newest estimate, perturbation included.
        added: Part of the error that a perturbation adds; the stated standard deviations leave it
            out.
        error_row: (4,) the error as x, y, z, m, and heading, rad; it stays the same array.
        tracked: (2, 4) the error as the controller feels it, and its rate; written at every
            physics step.
    """

    def __init__(
        self,
        config: Config,
        timestep: float,
        steps: int,
        position: Array,
        heading: float,
        legs: bool = False,
    ) -> None:
        """Start at the true position (3,) and heading.

        Args:
            config: Odometry, perturbation and seed.
            timestep: Physics step, s.
            steps: Number of physics steps that a trail covers.
            position: (3,) m.
            heading: rad.
            legs: Whether the body stands on legs, which measure its height.
        """
        self._config = config
        self._perturbation = config.perturbation or UNPERTURBED
        self._stride = max(1, round(1.0 / (config.odometry.rate * timestep)))
        period = self._stride * timestep
        self._odometry = Odometry(
            config.odometry, config.seed, position, heading, period, legs=legs
        )
        self._period_ns = round(period * 1e9)
        self._due_ns = self._period_ns
        self._errors: deque[PoseError] = deque(maxlen=steps)
        self.error_row = np.zeros(4)
        self._update_perturbation(0)
        self.tracked = np.array([self.error_row, np.zeros(4)])

    def state(self) -> dict[str, Array]:
        """The odometry, the time of the next estimate, errors of the trail (n, 4), the filter."""
        errors = [(*one.shift, one.turn) for one in self._errors]
        return {
            **{f"odometry.{name}": array for name, array in self._odometry.state().items()},
            "due_ns": np.array(self._due_ns, np.int64),
            "errors": np.array(errors).reshape(-1, 4),
            "added": np.array([*self.added.shift, self.added.turn]),
            "tracked": self.tracked.copy(),
        }

    def restore(self, state: dict[str, Array]) -> None:
        """Continue from what `state` returned.

        Raises:
            ValueError: The tracked error has another shape.
        """
        if state["tracked"].shape != self.tracked.shape:
            raise ValueError(f"tracked: got {state['tracked'].shape}, expected (2, 4)")
        prefix = "odometry."
        own = {n.removeprefix(prefix): a for n, a in state.items() if n.startswith(prefix)}
        self._odometry.restore(own)
        self._due_ns = int(state["due_ns"])
        self._errors.clear()
        self._errors.extend(_pose_error(row) for row in state["errors"])
        self.added = _pose_error(state["added"])
        self._update_error()
        self.tracked[:] = state["tracked"]

    def advance(self, time_ns: int, position: Array, quaternion: Array) -> None:
        """Make the next estimate if its time has come; the true pose is (3,) and (4,)."""
        if time_ns < self._due_ns:
            return
        self._due_ns += self._period_ns
        self._odometry.advance(position, yaw_of_quaternion(quaternion))
        self._update_perturbation(time_ns)

    def record_step(self) -> None:
        """Record the error of this physics step for the trail."""
        self._errors.append(self.error)

    def pose(self, trail: Trail, rolling: bool) -> pb.Pose:
        """Encode the estimated pose for the log.

        Args:
            trail: True poses of the base at each step since the sweeps began, and now; now alone
                without a rolling shutter.
            rolling: Whether a sensor has a rolling shutter, so that the stack needs the trail.
        """
        errors = [*self._errors, self.error] if rolling else [self.error]
        believed = estimated_trail(trail, errors)
        message = pb.Pose(
            position=believed.positions[-1].tolist(),
            quaternion=believed.quaternions[-1].tolist(),
            position_sigma=self._odometry.position_sigma,
            heading_sigma=self._odometry.heading_sigma,
        )
        if rolling:
            sampled = believed.every(self._stride)
            message.history_positions.extend(sampled.positions.ravel().tolist())
            message.history_quaternions.extend(sampled.quaternions.ravel().tolist())
            message.history_period_s = sampled.period
        return message

    def _update_perturbation(self, time_ns: int) -> None:
        travelled = self._odometry.travelled
        self.added = self._perturbation.pose_error(self._config.seed, time_ns, travelled)
        self._update_error()

    def _update_error(self) -> None:
        self.error = self._odometry.error + self.added
        self.error_row[:] = *self.error.shift, self.error.turn


def _pose_error(row: Array) -> PoseError:
    x, y, z, turn = row.tolist()
    return PoseError((x, y, z), turn)
