"""Inputs of a decision from one batch of recorded sweeps, as messages of the log."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.shadow.batches import Batch
from wayproof.harness.shadow.odometry import RecordedOdometry
from wayproof.harness.shadow.own_maps import written
from wayproof.harness.shadow.perturb import RecordedPerturbation
from wayproof.harness.shadow.prepare import Prepared, lifted
from wayproof.harness.shadow.sweeps import greatest_age
from wayproof.harness.shadow.way import RecordedPose
from wayproof.models.poses import Trail

TRAIL_PERIOD_NS = 10_000_000
"""Time between two poses of a trail, ns."""

MOST_TRAIL = 256
"""Maximum number of poses in a trail."""


class Given(NamedTuple):
    """Inputs of one decision, and the robot's motion since the one before.

    Attributes:
        sweeps: Sweeps as the stack gets them.
        pose: Pose as the stack gets it.
        goal: Goal of the decision.
        motion: Recorded.
    """

    sweeps: list[pb.Sweep]
    pose: pb.Pose
    goal: pb.Goal
    motion: pb.RecordedMotion


class InputWriter:
    """Writes the inputs of one pass through a recording, batch by batch."""

    def __init__(self, prepared: Prepared, perturbation: RecordedPerturbation) -> None:
        """Start before the first batch."""
        self._prepared, self._perturbation = prepared, perturbation
        self._odometry: RecordedOdometry | None = None
        if prepared.config.estimate.kind == "lidar":
            self._odometry = RecordedOdometry(prepared)
        self._before: RecordedPose | None = None
        self._before_ns = 0
        self._before_maps_ns = -(2**62)  # the first decision has the maps from before it too

    def write(self, batch: Batch, sequence: int) -> Given:
        """Write the inputs of the next decision."""
        self._perturbation.begin(batch.time_ns)
        motion = self._motion(batch.time_ns, sequence)
        sweeps = self._perturbation.changed(self._sweeps(batch, sequence), sequence)
        pose = self._pose(sweeps, motion, batch.time_ns, sequence)
        goal = pb.Goal(sequence=sequence, position=self._prepared.way.goal(batch.time_ns).tolist())
        goal.timestamp.FromNanoseconds(batch.time_ns)
        return Given(sweeps, pose, goal, motion)

    def _sweeps(self, batch: Batch, sequence: int) -> list[pb.Sweep]:
        prepared, places = self._prepared, list(self._prepared.writers)
        sweeps = [sweep for sweep in batch.sweeps if sweep.sensor in prepared.writers]
        if all(sweep.measured is not None for sweep in sweeps):
            sweeps.sort(key=lambda sweep: places.index(sweep.sensor))  # as the episode's were
        return [
            prepared.writers[sweep.sensor].write(
                sweep, lifted(sweep.T_body_sensor, prepared.lift), batch.time_ns, sequence
            )
            for sweep in sweeps
        ]

    def _motion(self, time_ns: int, sequence: int) -> pb.RecordedMotion:
        """Return the robot's motion since the decision before."""
        way, pose = self._prepared.way, self._prepared.way.pose(time_ns)
        before = pose if self._before is None else self._before
        begin_ns = self._before_ns if self._before is not None else time_ns
        poses = way.between(begin_ns, time_ns)
        poses[0], poses[-1] = before.row, pose.row  # one row where the way is not known
        velocity = np.zeros(3)
        if time_ns > begin_ns:
            velocity = (pose.position - before.position) / ((time_ns - begin_ns) * 1e-9)
        message = pb.RecordedMotion(
            sequence=sequence,
            position=pose.position.tolist(),
            quaternion=pose.quaternion.tolist(),
            velocity=velocity.tolist(),
            way=poses.ravel().tolist(),
            own_maps=written(self._prepared.own_maps, self._before_maps_ns, time_ns),
        )
        self._before_maps_ns = time_ns
        message.timestamp.FromNanoseconds(time_ns)
        self._before, self._before_ns = pose, time_ns
        return message

    def _pose(
        self, sweeps: Sequence[pb.Sweep], motion: pb.RecordedMotion, time_ns: int, sequence: int
    ) -> pb.Pose:
        """Return the pose that the stack is given, with a trail where beams are older."""
        message = pb.Pose(
            sequence=sequence,
            position=motion.position,
            quaternion=motion.quaternion,
            position_sigma=self._prepared.recorded.position_sigma,
        )
        message.timestamp.FromNanoseconds(time_ns)
        of_tables = [writer.age_ns for writer in self._prepared.writers.values()]
        if (age := max([greatest_age(sweeps), *of_tables])) > 0:
            # As far apart as they are known, so that an episode's are those that it had.
            step_ns = self._prepared.way.step_ns if any(of_tables) else TRAIL_PERIOD_NS
            trail = self._trail(time_ns, age, step_ns)
            message.history_positions.extend(trail.positions.ravel().tolist())
            message.history_quaternions.extend(trail.quaternions.ravel().tolist())
            message.history_period_s = trail.period
        if self._odometry is not None:
            self._odometry.estimate(sweeps, message, time_ns)
        return self._perturbation.estimate(message, motion)

    def _trail(self, time_ns: int, age_ns: int, step_ns: int) -> Trail:
        """Select poses up to a time, from at least an age before it, so far apart if possible."""
        period_ns = max(step_ns, -(-age_ns // (MOST_TRAIL - 1)))
        steps = np.arange(-(-age_ns // period_ns), -1, -1, dtype=np.int64)
        times = np.maximum(time_ns - steps * period_ns, 0)
        return Trail(*self._prepared.way.at(times), period_ns * 1e-9)
