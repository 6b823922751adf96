"""The setpoints of the physics steps to come, sampled together rather than one by one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.models.robots import Setpoint
from wayproof.planners import Trajectory

Array = NDArray[np.float64]


class SetpointBuffer:
    """What a trajectory asks for, step by step; sampled anew when the trajectory changes.

    Attributes:
        planned: (n, 8) rows of setpoints, in the frame of the trajectory.
        asked: (n, 8) the same as the controller gets them, each to be written before its step.
        row: Of the next one.
    """

    def __init__(self, step_ns: int, steps: int) -> None:
        """Look so many physics steps of so many ns ahead."""
        self._offsets = step_ns * np.arange(steps, dtype=np.int64)
        self._trajectory: Trajectory | None = None
        self._times: list[int] = []
        self._told: list[bytes] = []  # since they were taken last, of earlier samples
        self._taken = 0  # rows of this sample
        self.planned, self.asked, self.row = np.zeros((0, 8)), np.zeros((0, 8)), 0

    def holds(self, trajectory: Trajectory, time_ns: int) -> bool:
        """Whether the next one is that of this time; a step need not last whole ns."""
        return (
            trajectory is self._trajectory
            and self.row < len(self._times)
            and self._times[self.row] == time_ns
        )

    def sample(self, trajectory: Trajectory, time_ns: int) -> None:
        """Begin anew, from this time on."""
        self._told.append(self.asked[self._taken : self.row].tobytes())
        times = time_ns + self._offsets
        self.planned = np.column_stack(trajectory.setpoints(times))
        self.asked = np.empty_like(self.planned)
        self._trajectory, self._times = trajectory, times.tolist()
        self.row = self._taken = 0

    def next(self) -> Setpoint:
        """What the controller is asked for now."""
        self.row += 1
        return Setpoint.of(self.asked[self.row - 1])

    def drain_setpoints(self) -> bytes:
        """All that `next` has told since this was called last.

        All of it: where two trajectories begin alike, they may ask for other speeds already.
        """
        asked = b"".join(self._told) + self.asked[self._taken : self.row].tobytes()
        self._told.clear()
        self._taken = self.row
        return asked
