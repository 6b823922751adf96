"""A perturbation of recorded input: exactly one assumption of the stack made wrong.

The poses, the ranges, the mount that the stack is given, which sweeps arrive, or the delay of
decisions; the recorded world itself cannot be changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.geometry import polyline_length
from wayproof.harness.input_messages import beams_from_info, decode_ranges
from wayproof.harness.listed_beams import read_list, write_list
from wayproof.harness.perturbations import Displacement, Report
from wayproof.harness.perturbations.injection import Injection
from wayproof.harness.perturbations.perturbation import ListedDirections, Ranges
from wayproof.harness.recordings.transform import Transform, compose, quaternion_of
from wayproof.harness.result import way_of
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.shadow.way import Array
from wayproof.models.pose_model import PoseError, estimated_trail
from wayproof.models.poses import Trail
from wayproof.models.sensors import codecs
from wayproof.models.sensors.beams import NO_RETURN, BeamTable

NO_TABLE = BeamTable(np.empty((0, 2)), np.empty((0, 2)), 0, order="list")

NOT_RECORDED = {
    "world": "the world, which a recording cannot; expected one of the poses, the ranges or the",
    "prior": (
        "the prior map, which a recording does not take; expected one of the poses, the ranges or "
        "the"
    ),
    "motion_sensors": (
        "inertial sensors, which the odometry of a recording does not read; expected one of the "
        "ranges or the"
    ),
}
"""What some perturbations change that a recording has not."""


@dataclass(frozen=True)
class RecordedDevice:
    """Limits of a recorded sensor, as perturbations read them.

    Attributes:
        range: Longest range that counts, m.
        minimum_range: m.
        no_return_is_free: Whether a lost echo would be reported as free space.
    """

    range: float
    minimum_range: float = 0.0
    no_return_is_free: bool = False


class RecordedPerturbation(Injection):
    """The perturbation of one pass through a recording, or none."""

    def __init__(self, config: Config, infos: Sequence[pb.SensorInfo]) -> None:
        """Find the sensors that it affects.

        Raises:
            InputError: It changes the world, or sensors or a prior map that a recording does not
                have.
        """
        kind = config.perturbation
        if kind is not None and kind.changes in NOT_RECORDED:
            raise InputError(
                f"perturbation '{kind.kind}': changes {NOT_RECORDED[kind.changes]} timing"
            )
        super().__init__(
            kind,
            config.seed,
            [info.name for info in infos],
            round(1e9 / max(next(iter(infos)).rate_hz, 1e-3)) if infos else 10**8,
            registers=config.estimate.kind == "lidar",
        )
        self._infos = {info.name: info for info in infos}
        self._first: dict[str, Array] = {}  # directions of the first sweep of each sensor
        self._travelled = 0.0
        self.added = PoseError()

    def changed(self, sweeps: list[pb.Sweep], sequence: int) -> list[pb.Sweep]:
        """Return the sweeps that the stack gets at a decision, changed in place."""
        for sweep in sweeps if self._active and self.delivery is None else ():
            if sweep.sensor in self._affected:
                self._change(sweep, sequence)
        return self.sweeps(sweeps)

    def estimate(self, pose: pb.Pose, motion: pb.RecordedMotion) -> pb.Pose:
        """Return the pose that the stack gets: with an error, or a late one in its place."""
        self._travelled += polyline_length(way_of(motion)[:, :3])
        self.added = self._perturbation.pose_error(self._seed, self._time_ns, self._travelled)
        if self.added != PoseError():
            move(pose, self.added)
        return self.pose(pose)

    def _change(self, sweep: pb.Sweep, sequence: int) -> None:
        """Change the ranges of a sweep, or the mount that it states."""
        info = self._infos[sweep.sensor]
        if self._displacement is not None:
            _displace(sweep, info, self._displacement)
            return
        beams, ranges = read_list(sweep), decode_ranges(sweep)
        listed, table = None, NO_TABLE
        if beams is None:
            table = beams_from_info(info).table
        else:
            first = self._first.setdefault(sweep.sensor, beams.directions)
            listed, ranges = ListedDirections(beams.directions, first), ranges.astype(np.uint32)
        device = RecordedDevice(info.range_m)
        report = Report(sweep.sensor, device, table, ranges, self._seed, sequence, listed)
        perturbed = self.perturbed(report)
        if beams is None:
            sweep.ranges = codecs.encode_image(perturbed.astype(np.uint16), sweep.rows)
            return
        ages, directions = tuple(sweep.ages_ns) or (0,), sweep.directions
        del sweep.ages_ns[:]
        write_list(
            sweep,
            beams.directions,
            ranges_mm=perturbed.astype(np.uint32),
            poses=beams.poses,
            ages_ns=ages,
        )
        sweep.directions = directions  # kept as recorded: coding them again may round them

    def perturbed(self, report: Report) -> Ranges:
        """Return ranges whose echoes do not have the value that means no return."""
        changed = self._perturbation.report(report).copy()
        changed[(changed == NO_RETURN) & (report.ranges_mm != NO_RETURN)] = NO_RETURN - 1
        self._changed_beams += int((changed != report.ranges_mm).sum())
        return changed


def move(pose: pb.Pose, error: PoseError) -> None:
    """Move a pose and its trail by an error, in place."""
    now = Trail(np.array([pose.position]), np.array([pose.quaternion]), 1.0)
    believed = estimated_trail(now, [error])
    pose.position[:] = believed.positions[0].tolist()
    pose.quaternion[:] = believed.quaternions[0].tolist()
    if not pose.history_period_s:
        return
    positions = np.array(pose.history_positions).reshape(-1, 3)
    quaternions = np.array(pose.history_quaternions).reshape(-1, 4)
    trail = Trail(positions, quaternions, pose.history_period_s)
    believed = estimated_trail(trail, [error] * len(positions))
    pose.history_positions[:] = believed.positions.ravel().tolist()
    pose.history_quaternions[:] = believed.quaternions.ravel().tolist()


def _displace(sweep: pb.Sweep, info: pb.SensorInfo, displacement: Displacement) -> None:
    """State a mount that is displaced from the true one, T_base_sensor D."""
    if sweep.mount:
        stated = Transform(np.array(sweep.mount[:3]), np.array(sweep.mount[3:]))
    else:
        R = np.array(info.rotation_base_sensor).reshape(3, 3)
        stated = Transform(np.array(info.position_base_sensor), quaternion_of(R))
    moved = compose(stated, Transform(displacement.position, displacement.quaternion))
    sweep.mount[:] = [*moved.position.tolist(), *moved.quaternion.tolist()]
