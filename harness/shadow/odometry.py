"""Pose of a recorded robot by its sweeps: the lidar odometry in place of the recorded poses.

The recorded poses are its prediction from sweep to sweep, as the odometry of wheels or legs is.
What they add up to does not count.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.estimators.lidar_odometry import LidarOdometry, put_estimate
from wayproof.harness.estimators.motion_sensors import Motion
from wayproof.harness.geometry import yaw_of_quaternion
from wayproof.harness.input_messages import beams_from_info, decode_ranges
from wayproof.harness.inputs import Pose, SweepInput
from wayproof.harness.listed_beams import read_list
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.shadow.perturb import move
from wayproof.harness.shadow.prepare import Prepared
from wayproof.models.poses import Trail

Array = NDArray[np.float64]

LEVEL, WALLS = (0.0,), (0.25, -0.25)
"""Heights from the middle of a voxel at which a point of a planar laser is put, in voxels: once
where it is registered, twice in the map, as the laser sees walls, which are upright."""

LEAST_PERIOD = 1e-3
"""Least time between two decisions that counts, s."""


class RecordedMotion:
    """Motion between two decisions by the recorded poses.

    Attributes:
        period: Time of it, s.
        step: (3,) world, m.
    """

    def __init__(self) -> None:
        """Start at rest."""
        self.period = LEAST_PERIOD
        self.step = np.zeros(3)

    def measure(self, turn: float) -> Motion:
        """Return the motion; `turn`, rad, is the recorded one."""
        return Motion(np.zeros(3), turn, None, step=self.step)

    def state(self) -> dict[str, Array]:
        """Return nothing: a recording is not continued from a snapshot."""
        return {}

    def restore(self, state: dict[str, Array]) -> None:
        """Do nothing: a recording is not continued from a snapshot."""


class RecordedOdometry:
    """The odometry of one pass through a recording."""

    def __init__(self, prepared: Prepared) -> None:
        """Start before the first decision."""
        self._config = prepared.config.estimate
        self._beams = {info.name: beams_from_info(info) for info in prepared.infos}
        self._planar = prepared.planar
        self._only_planar = prepared.planar.issuperset(self._beams)
        self._motion = RecordedMotion()
        self._lidar: LidarOdometry | None = None
        self._before_ns = 0
        self._position = np.zeros(3)

    def estimate(self, sweeps: Sequence[pb.Sweep], message: pb.Pose, time_ns: int) -> None:
        """Put the estimate, with its covariance, in the place of the recorded pose of a message.

        Args:
            sweeps: Sweeps of the decision, as the stack gets them.
            message: The recorded pose, with its trail; written.
            time_ns: Time of the decision.
        """
        position = np.array(message.position)
        heading = yaw_of_quaternion(np.array(message.quaternion))
        if self._lidar is None:
            self._lidar = LidarOdometry(
                self._config, position, heading, self._motion, planar=self._only_planar
            )
        else:
            elapsed = 1e-9 * (time_ns - self._before_ns)
            self._motion.period = max(elapsed, LEAST_PERIOD)
            self._motion.step = position - self._position
            self._lidar.advance(position, heading)
        self._before_ns, self._position = time_ns, position
        inputs = [
            SweepInput(one.sensor, decode_ranges(one), None, read_list(one)) for one in sweeps
        ]
        recorded = pb.Pose()
        recorded.CopyFrom(message)
        move(message, self._lidar.error)
        walls = not self._only_planar  # one point for each beam, where there is no other lidar
        self._lidar.correct(self._points(inputs, message, walls))
        message.CopyFrom(recorded)
        move(message, self._lidar.error)
        put_estimate(message, self._lidar)
        covariance = np.array(message.covariance).reshape(4, 4)
        points = self._points(inputs, message, walls=True)
        self._lidar.add_to_map(points, np.array(message.position), covariance)

    def _points(self, sweeps: Sequence[SweepInput], message: pb.Pose, walls: bool) -> Array:
        """Place returns (n, 3), world, m; of planar lasers at the middle of a voxel's height.

        Args:
            sweeps: Sweeps of a decision.
            message: Pose at which they are placed.
            walls: Whether each return of a planar laser is put above and below that height.
        """
        trail = None
        if message.history_period_s:
            positions = np.array(message.history_positions).reshape(-1, 3)
            quaternions = np.array(message.history_quaternions).reshape(-1, 4)
            trail = Trail(positions, quaternions, message.history_period_s)
        pose = Pose(np.array(message.position), np.array(message.quaternion), 0.0, trail)
        sequence = message.sequence
        placed = [np.zeros((0, 3))]
        for sweep in sweeps:
            points = self._beams[sweep.sensor].place(sweep, pose, sequence).points
            if sweep.sensor in self._planar:
                points = self._levelled(points, WALLS if walls else LEVEL)
            placed.append(points)
        return np.concatenate(placed)

    def _levelled(self, points: Array, heights: tuple[float, ...]) -> Array:
        """Return points (n, 3) of a planar laser, heights from a voxel's middle, in voxels."""
        voxel, levelled = self._config.voxel, np.repeat(points, len(heights), axis=0)
        middle = np.floor(levelled[:, 2] / voxel + 0.5) * voxel
        levelled[:, 2] = middle + voxel * np.tile(heights, len(points))
        return levelled
