"""A perturbation of recorded input: exactly one assumption of the stack made wrong.

The poses, the ranges, the mount that the stack is given, which sweeps arrive, or the delay of
decisions; the recorded world itself cannot be changed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.errors import InputError
from wayproof.harness.geometry import polyline_length
from wayproof.harness.input_messages import beams_from_info, decode_ranges
from wayproof.harness.listed_beams import read_list, write_list
from wayproof.harness.perturbations import UNPERTURBED, Displacement, Report
from wayproof.harness.perturbations.delivery import Delivery
from wayproof.harness.perturbations.perturbation import ListedDirections, Ranges
from wayproof.harness.result import way_of
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.shadow.way import Array
from wayproof.models.pose_model import PoseError, estimated_trail
from wayproof.models.poses import Trail, rotation_matrices
from wayproof.models.sensors import range_codec
from wayproof.models.sensors.beams import NO_RETURN, BeamTable

NO_TABLE = BeamTable(np.empty((0, 2)), np.empty((0, 2)), 0, order="list")


@dataclass(frozen=True)
class RecordedDevice:
    """Limits of a recorded sensor, as perturbations read them.

    Attributes:
        range: Longest range that counts, m.
        minimum_range: m.
        no_return_is_free: Whether a lost echo would be reported as free space.
    """

    range: float
    minimum_range: float
    no_return_is_free: bool


class RecordedPerturbation:
    """The perturbation of one pass through a recording, or none."""

    def __init__(self, config: Config, infos: Sequence[pb.SensorInfo]) -> None:
        """Find the sensors that it affects.

        Raises:
            InputError: It changes the world, or sensors or a prior map that a recording does not
                have.
        """
        self._perturbation = config.perturbation or UNPERTURBED
        if self._perturbation.changes == "world":
            raise InputError(
                f"perturbation '{self._perturbation.kind}': changes the world, which a recording "
                "cannot; expected one of the poses, the ranges or the timing"
            )
        if self._perturbation.changes == "prior":
            raise InputError(
                f"perturbation '{self._perturbation.kind}': changes the prior map, which a "
                "recording does not take; expected one of the poses, the ranges or the timing"
            )
        if self._perturbation.changes == "motion_sensors":
            raise InputError(
                f"perturbation '{self._perturbation.kind}': changes inertial sensors, which the "
                "odometry of a recording does not read; expected one of the ranges or the timing"
            )
        self._registers = config.estimate.kind == "lidar"
        self._seed = config.seed
        self._infos = {info.name: info for info in infos}
        self._affected = self._perturbation.affected(list(self._infos))
        self._displacement = self._perturbation.displacement(config.seed)
        self._first: dict[str, Array] = {}  # directions of the first sweep of each sensor
        self._travelled, self._changed_beams = 0.0, 0
        self._added, self._withheld = PoseError(), list[str]()
        period_ns = round(1e9 / max(next(iter(infos)).rate_hz, 1e-3)) if infos else 10**8
        self._delivery = Delivery(self._perturbation, config.seed, period_ns)

    def sweeps(self, sweeps: list[pb.Sweep], time_ns: int, sequence: int) -> list[pb.Sweep]:
        """Return the sweeps that the stack gets at a decision, changed in place."""
        active = self._perturbation.is_active(time_ns)
        self._changed_beams, self._withheld = 0, []
        if self._perturbation.changes == "arrivals":
            return self._delivered(sweeps)
        for sweep in sweeps if active else ():
            if sweep.sensor in self._affected:
                self._change(sweep, sequence)
        return sweeps

    def _delivered(self, sent: list[pb.Sweep]) -> list[pb.Sweep]:
        """Return the sweeps that come in place of those that were sent."""
        came, withheld = self._delivery.take_sweeps(sent, self._affected)
        self._withheld += withheld
        return came

    def pose(self, pose: pb.Pose, motion: pb.RecordedMotion, time_ns: int) -> None:
        """Add the error to the pose that the stack gets, or put a late one in its place."""
        if self._perturbation.delays_pose:
            pose.CopyFrom(self._delivery.take("pose", pose) or pose)
            return
        self._travelled += polyline_length(way_of(motion)[:, :3])
        self._added = self._perturbation.pose_error(self._seed, time_ns, self._travelled)
        if self._added == PoseError():
            return
        now = Trail(np.array([pose.position]), np.array([pose.quaternion]), 1.0)
        believed = estimated_trail(now, [self._added])
        del pose.position[:], pose.quaternion[:]
        pose.position.extend(believed.positions[0].tolist())
        pose.quaternion.extend(believed.quaternions[0].tolist())
        if not pose.history_period_s:
            return
        positions = np.array(pose.history_positions).reshape(-1, 3)
        quaternions = np.array(pose.history_quaternions).reshape(-1, 4)
        trail = Trail(positions, quaternions, pose.history_period_s)
        believed = estimated_trail(trail, [self._added] * len(positions))
        del pose.history_positions[:], pose.history_quaternions[:]
        pose.history_positions.extend(believed.positions.ravel().tolist())
        pose.history_quaternions.extend(believed.quaternions.ravel().tolist())

    def delay(self, time_ns: int) -> float:
        """Return the delay added to a decision, s."""
        if not self._perturbation.is_active(time_ns):
            return 0.0
        return self._perturbation.delay_at(self._seed, time_ns)

    def message(self, sequence: int, time_ns: int) -> pb.Perturbation | None:
        """Describe the perturbation of a decision's inputs for the log; None if unperturbed."""
        perturbation = self._perturbation
        if perturbation is UNPERTURBED:
            return None
        active = perturbation.is_active(time_ns)
        message = pb.Perturbation(
            sequence=sequence,
            kind=perturbation.kind,
            severity=math.ceil(perturbation.severity),
            exact_severity=perturbation.severity,
            amount=perturbation.amount if active else perturbation.nothing,
            unit=perturbation.unit,
            streams=self._streams,
            pose_shift=self._added.shift,
            pose_turn=self._added.turn,
            changed_beams=self._changed_beams,
            withheld=self._withheld,
            added_delay_s=self.delay(time_ns),
            evidence_age_s=self._delivery.evidence_age_s,
        )
        if self._displacement is not None and active:
            message.displaced_position.extend(self._displacement.position.tolist())
            message.displaced_quaternion.extend(self._displacement.quaternion.tolist())
        message.timestamp.FromNanoseconds(time_ns)
        return message

    @property
    def _streams(self) -> tuple[str, ...]:
        """Input streams that the perturbation changes; of the lidar's pose with its sweeps."""
        own = self._perturbation.streams(list(self._infos))
        sensed = any(name.startswith("sensor/") for name in own)
        return (*own, "pose") if sensed and self._registers else own

    def _change(self, sweep: pb.Sweep, sequence: int) -> None:
        """Change the ranges of a sweep, or the mount that it states."""
        info = self._infos[sweep.sensor]
        if self._displacement is not None:
            _displace(sweep, info, self._displacement)
            return
        beams, ranges = read_list(sweep), decode_ranges(sweep).astype(np.uint32)
        if beams is None:
            self._change_measured(sweep, info, sequence)
            return
        first = self._first.setdefault(sweep.sensor, beams.directions)
        device = RecordedDevice(info.range_m, 0.0, no_return_is_free=False)
        listed = ListedDirections(beams.directions, first)
        report = Report(
            sensor=sweep.sensor,
            device=device,
            table=NO_TABLE,
            ranges_mm=ranges,
            seed=self._seed,
            sequence=sequence,
            listed=listed,
        )
        perturbed = _without_mark(self._perturbation.report(report), report)
        self._changed_beams += int((perturbed != ranges).sum())
        ages, poses = tuple(sweep.ages_ns) or (0,), beams.poses
        del sweep.ages_ns[:]
        directions = sweep.directions  # kept as recorded: coding them again may round anew
        write_list(
            sweep,
            beams.directions,
            ranges_mm=perturbed.astype(np.uint32),
            poses=poses,
            ages_ns=ages,
        )
        sweep.directions = directions

    def _change_measured(self, sweep: pb.Sweep, info: pb.SensorInfo, sequence: int) -> None:
        """Change the ranges of a sweep whose sensor has tables."""
        ranges, table = decode_ranges(sweep), beams_from_info(info).table
        device = RecordedDevice(info.range_m, 0.0, no_return_is_free=False)
        report = Report(sweep.sensor, device, table, ranges, self._seed, sequence)
        perturbed = _without_mark(self._perturbation.report(report), report)
        self._changed_beams += int((perturbed != ranges).sum())
        sweep.ranges = range_codec.encode(perturbed.astype(np.uint16), sweep.rows)


def _without_mark(perturbed: Ranges, report: Report) -> Ranges:
    """Return ranges whose echoes do not have the value that means no return."""
    marked = (perturbed == NO_RETURN) & (report.ranges_mm != NO_RETURN)
    changed = perturbed.copy()
    changed[marked] = NO_RETURN - 1
    return changed


def _displace(sweep: pb.Sweep, info: pb.SensorInfo, displacement: Displacement) -> None:
    """State a mount that is displaced from the true one, T_base_sensor D."""
    if sweep.mount:
        position, quaternion = np.array(sweep.mount[:3]), np.array(sweep.mount[3:])
    else:
        position = np.array(info.position_base_sensor)
        quaternion = _quaternion(np.array(info.rotation_base_sensor).reshape(3, 3))
    R = rotation_matrices(quaternion[None])[0]
    shifted = position + (R * displacement.position).sum(axis=1)
    w, x, y, z = quaternion
    a, b, c, d = displacement.quaternion
    turned = [
        w * a - x * b - y * c - z * d,
        w * b + x * a + y * d - z * c,
        w * c - x * d + y * a + z * b,
        w * d + x * c - y * b + z * a,
    ]
    del sweep.mount[:]
    sweep.mount.extend([*shifted.tolist(), *turned])


def _quaternion(R: Array) -> Array:
    """Return the unit quaternion (4,) w x y z of a rotation (3, 3), from its greatest component.

    Shepperd 1978, "Quaternion from rotation matrix".
    """
    diagonal = np.diag(R)
    squares = np.array([1.0 + diagonal.sum(), *(1.0 - diagonal.sum() + 2.0 * diagonal)])
    best = int(squares.argmax())
    products = np.empty((4, 4))
    products[0, 0], products[1:, 1:] = squares[0], R + R.T
    products[range(1, 4), range(1, 4)] = squares[1:]
    cross = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    products[0, 1:] = products[1:, 0] = cross
    row = products[best]
    unit: Array = row / np.sqrt((row * row).sum())
    return unit
