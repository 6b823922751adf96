"""Setpoints of the physics steps to come, sampled together rather than one by one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.models.robots import Setpoint
from wayproof.planners import Trajectory

Array = NDArray[np.float64]


class SetpointBuffer:
    """Setpoints of a trajectory, step by step; sampled anew when the trajectory changes.

    Attributes:
        planned: (n, 8) rows of setpoints by the trajectory, in the frame of the pose estimate.
        commanded: (n, 8) the same as the controller gets them, world frame; a row is written before
            its step.
        row: Index of the next one.
    """

    def __init__(self, step_ns: int, steps: int) -> None:
        """Sample `steps` physics steps of `step_ns` each ahead."""
        self._offsets = step_ns * np.arange(steps, dtype=np.int64)
        self._trajectory: Trajectory | None = None
        self._times: list[int] = []
        self._undrained: list[bytes] = []  # of earlier samples
        self._drained = 0  # rows of this sample
        self.planned, self.commanded, self.row = np.zeros((0, 8)), np.zeros((0, 8)), 0

    def holds(self, trajectory: Trajectory, time_ns: int) -> bool:
        """Return whether the next setpoint is that of this time; a step need not last whole ns."""
        return (
            trajectory is self._trajectory
            and self.row < len(self._times)
            and self._times[self.row] == time_ns
        )

    def sample(self, trajectory: Trajectory, time_ns: int) -> None:
        """Sample a trajectory from a time on, ns."""
        self._undrained.append(self.commanded[self._drained : self.row].tobytes())
        times = time_ns + self._offsets
        self.planned = np.column_stack(trajectory.setpoints(times))
        self.commanded = np.empty_like(self.planned)
        self._trajectory, self._times = trajectory, times.tolist()
        self.row = self._drained = 0

    def next(self) -> Setpoint:
        """Take the next setpoint for the controller."""
        self.row += 1
        return Setpoint.of(self.commanded[self.row - 1])

    def drain_setpoints(self) -> bytes:
        """Return rows of all setpoints taken since the last call.

        Of every sample: two trajectories that begin alike may already command other speeds.
        """
        rows = b"".join(self._undrained) + self.commanded[self._drained : self.row].tobytes()
        self._undrained.clear()
        self._drained = self.row
        return rows
