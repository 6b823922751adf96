"""Inputs of a decision: poses and sweeps exactly as they are in the log."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from google.protobuf.message import Message
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.geometry import yaw_of_quaternion
from wayproof.harness.listed_beams import (
    CODEC,
    WIDE_CODEC,
    ListedBeams,
    Mount,
    check_count,
    read_list,
    read_mount,
    read_ranges,
)
from wayproof.harness.prediction.predicted_box import PredictedBox, read_prediction
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.maps.sweep import Ranges
from wayproof.models.classes import CLASSES
from wayproof.models.poses import Trail, rotation_matrices
from wayproof.models.sensors import range_codec
from wayproof.models.sensors.beams import (
    DROPPED,
    LONGEST_LISTED_RANGE,
    LONGEST_RANGE,
    NO_RETURN,
    BeamTable,
    directions,
    pose_indices,
    pose_offsets,
    ray_ranges,
    rotate,
)

MAX_COORDINATE = 1e5
"""Maximum distance from the world's origin along an axis, m; beyond any mission."""

MAX_VARIANCE = 1e12
"""Greatest variance of a pose, m^2 and rad^2."""

ASYMMETRY = 1e-9
"""Share of its largest entry by which rounding may leave a covariance asymmetric."""

NONE_UNHELD = np.zeros((0, 3))
"""No direction that the sweeps do not hold; read-only, as all poses without one share it."""

NONE_UNHELD.flags.writeable = False

UNIT_LENGTH = 1e-9
"""Difference from unit length beyond which a quaternion is scaled to it."""


@dataclass(frozen=True)
class Pose:
    """The estimated pose T_world_base.

    Attributes:
        position: (3,) m.
        quaternion: (4,) w x y z.
        position_sigma: Stated standard deviation along the axis where it is greatest, m.
        heading_sigma: Stated standard deviation of the heading, rad.
        trail: Estimated poses while the sweeps were taken, up to this one; none without a rolling
            shutter.
        covariance: (4, 4) stated covariance of x, y, z, m, and heading, rad, in world axes; none if
            the estimator states standard deviations alone.
        unheld: (k, 3) unit directions along which the sweeps do not hold the position.
    """

    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    position_sigma: float
    trail: Trail | None = None
    heading_sigma: float = 0.0
    covariance: NDArray[np.float64] | None = None
    unheld: NDArray[np.float64] = field(default_factory=lambda: NONE_UNHELD)

    @cached_property
    def rotation(self) -> NDArray[np.float64]:
        """R_world_base, (3, 3)."""
        R_world_base: NDArray[np.float64] = rotation_matrices(self.quaternion[None])[0]
        return R_world_base

    @property
    def heading(self) -> float:
        """Yaw, rad."""
        return yaw_of_quaternion(self.quaternion)


@dataclass(frozen=True)
class WorldSweep:
    """A sweep's beams in the world frame.

    Attributes:
        origins: (m, 3) position of the sensor at each moment, m.
        directions: (n, 3) unit vectors.
        ranges_mm: (n,) along the beams.
        moments: (n,) int32 index of the origin of each beam.
    """

    origins: NDArray[np.float64]
    directions: NDArray[np.float64]
    ranges_mm: Ranges
    moments: NDArray[np.int32]

    @property
    def points(self) -> NDArray[np.float64]:  # (k, 3)
        """The returns, world frame, m."""
        return self.points_within(math.inf)

    def points_within(self, range_m: float) -> NDArray[np.float64]:  # (k, 3)
        """The returns of at most a range, world frame, m."""
        returned = (self.ranges_mm != DROPPED) & (self.ranges_mm != NO_RETURN)
        returned &= self.ranges_mm <= range_m * 1e3
        along = self.ranges_mm[returned, None] * 1e-3 * self.directions[returned]
        points: NDArray[np.float64] = self.origins[self.moments[returned]] + along
        return points

    def without_no_returns(self) -> WorldSweep:
        """The sweep with beams without return dropped."""
        silent = self.ranges_mm == NO_RETURN
        ranges_mm = self.ranges_mm.copy()
        ranges_mm[silent] = DROPPED
        return replace(self, ranges_mm=ranges_mm)


class Beams:
    """One sensor's geometry, rebuilt from its logged tables."""

    def __init__(
        self,
        table: BeamTable,
        range: float,
        rate: float,
        position_base_sensor: NDArray[np.float64],
        R_base_sensor: NDArray[np.float64],
    ) -> None:
        """Keep the tables, the range in m, the rate in Hz, and T_base_sensor."""
        self.table = table
        self.range = range
        self.rate = rate
        if not table.listed:
            self._ages = (-1e-9 * pose_offsets(table, round(1e9 / rate))).astype(np.float64)
            self._moments = pose_indices(table)
            self._directions = directions(table, 0)
        self._position_base_sensor = position_base_sensor
        self._R_base_sensor = R_base_sensor

    @property
    def mounting(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """T_base_sensor: position (3,), m, and rotation (3, 3)."""
        return self._position_base_sensor, self._R_base_sensor

    def place(self, sweep: SweepInput, pose: Pose, sequence: int) -> WorldSweep:
        """Transform a sweep into the world frame by an estimated pose.

        Raises:
            InputError: The sweep has another number of beams, or its shutter rolls and the pose
                has no trail.
        """
        if self.table.listed:
            return self._place_listed(sweep, pose)
        if len(sweep.ranges_mm) != self.table.beams or sweep.ranges_mm.dtype != np.uint16:
            raise InputError(
                f"sweep of '{sweep.sensor}': {len(sweep.ranges_mm)} beams, "
                f"expected {self.table.beams}"
            )
        if self.table.non_repetitive:
            self._directions = directions(self.table, sequence)
        several = self.table.scan_poses > 1
        origins, rotations = self._poses(pose, self._ages if several else None, *sweep.mount)
        one = len(rotations) == 1
        beams = rotate(rotations[0] if one else rotations[self._moments], self._directions)
        ranges = ray_ranges(self.table, self._directions, sweep.ranges_mm)
        return WorldSweep(origins, beams, ranges, self._moments)

    def ages_of(self, placed: WorldSweep) -> NDArray[np.float64]:
        """Ages of the returns of a placed sweep before its end, (k,) s; 0 if taken at once."""
        returned = (placed.ranges_mm != DROPPED) & (placed.ranges_mm != NO_RETURN)
        if self.table.listed or self.table.scan_poses == 1:
            return np.zeros(int(np.count_nonzero(returned)))
        ages: NDArray[np.float64] = self._ages[placed.moments[returned]]
        return ages

    def _place_listed(self, sweep: SweepInput, pose: Pose) -> WorldSweep:
        beams = sweep.beams
        if beams is None:
            raise InputError(f"sweep of '{sweep.sensor}': no beams, expected a list of them")
        position, R = beams.position_base_sensor, beams.R_base_sensor
        ages = beams.ages if beams.ages.any() else None
        origins, rotations = self._poses(pose, ages, position, R)
        one = len(rotations) == 1
        placed = rotate(rotations[0] if one else rotations[beams.poses], beams.directions)
        return WorldSweep(origins, placed, sweep.ranges_mm, beams.poses)

    def _poses(
        self,
        pose: Pose,
        ages: NDArray[np.float64] | None,
        position_base_sensor: NDArray[np.float64] | None = None,
        R_base_sensor: NDArray[np.float64] | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Estimated poses of the sensor: (m, 3), m, and (m, 3, 3), world.

        Args:
            pose: Of the base at the time of the decision.
            ages: (m,) before that, s; None for that time alone.
            position_base_sensor: (3,) m, in place of the sensor's own.
            R_base_sensor: (3, 3) likewise.
        """
        mounted, R = position_base_sensor, R_base_sensor
        if mounted is None or R is None:
            mounted, R = self._position_base_sensor, self._R_base_sensor
        positions, rotations = pose.position[None], pose.rotation[None]
        if ages is not None:
            if pose.trail is None:
                raise InputError("pose without a trail, expected one for a rolling shutter")
            positions, rotations = pose.trail.before_now(ages)
        origins = positions + turn(rotations, mounted[None])[:, 0]
        R_sensor_world = turn(rotations, R.T)
        return origins, np.ascontiguousarray(R_sensor_world.transpose(0, 2, 1))


def turn(rotations: NDArray[np.float64], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (k, 3) turned by each rotation (m, 3, 3), element by element: (m, k, 3)."""
    along = rotations[:, None] * vectors[None, :, None]  # (m, k, 3, 3)
    turned: NDArray[np.float64] = along[..., 0] + along[..., 1] + along[..., 2]
    return turned


@dataclass(frozen=True)
class SweepInput:
    """One sweep of a sensor.

    Attributes:
        sensor: Its name.
        ranges_mm: (n,) mm.
        classes: (n,) uint8 class of what each beam hit, if there are any.
        beams: Beams of a sweep that lists them; else those of the sensor's tables.
        mount: T_base_sensor of a sweep by tables, if it is not that of the sensor.
    """

    sensor: str
    ranges_mm: Ranges
    classes: NDArray[np.uint8] | None = None
    beams: ListedBeams | None = None
    mount: Mount = (None, None)


@dataclass(frozen=True)
class Inputs:
    """All that a decision depends on besides the decisions before it.

    Attributes:
        time_ns: Simulated time of the sweeps.
        sequence: Number of the decision.
        pose: Estimated pose at that time.
        sweeps: In the order in which they are integrated.
        digest: Hash of the messages that these were read from.
        goal: (3,) m, goal of this decision; None if it is the mission's.
        goals_reached: Number of goals reached before; 0 of a recording.
        prediction: What a predictor from outside said of the map before; None without one, and
            where it has no opinion.
    """

    time_ns: int
    sequence: int
    pose: Pose
    sweeps: tuple[SweepInput, ...]
    digest: str
    goal: NDArray[np.float64] | None = None
    goals_reached: int = 0
    prediction: PredictedBox | None = None


def inputs_from_messages(
    pose: pb.Pose,
    sweeps: Sequence[pb.Sweep],
    written: Sequence[bytes] | None = None,
    goal: pb.Goal | None = None,
    prediction: pb.Prediction | None = None,
) -> Inputs:
    """Read the inputs of one decision back from its messages.

    The recording itself decodes them too, so that it decides on what is in the log.

    Args:
        pose: The estimated pose.
        sweeps: In the order in which they are integrated.
        written: Sweeps, pose, goal and prediction serialized, if that is done already.
        goal: Goal of this decision; of recordings, and of missions with several goals.
        prediction: What a predictor from outside said before this decision.

    Raises:
        InputError: A sweep's codec is unknown, or its size is wrong.
    """
    if written is None:
        given = (*sweeps, pose, goal, prediction)
        written = [serialized(message) for message in given if message is not None]
    return Inputs(
        time_ns=pose.timestamp.ToNanoseconds(),
        sequence=pose.sequence,
        pose=_pose(pose),
        sweeps=tuple(
            SweepInput(
                sweep.sensor,
                decode_ranges(sweep),
                decode_classes(sweep),
                read_list(sweep),
                read_mount(sweep),
            )
            for sweep in sweeps
        ),
        digest=inputs_digest(written),
        goal=None if goal is None else _goal(goal),
        goals_reached=0 if goal is None else goal.index,
        prediction=None if prediction is None else read_prediction(prediction),
    )


def decode_classes(sweep: pb.Sweep) -> NDArray[np.uint8] | None:  # (rows * columns,)
    """Class of the surface that each beam hit; None without semantics.

    Raises:
        InputError: Not one byte for each beam, or one that is no class.
    """
    count = sweep.rows * sweep.columns
    if not sweep.classes:
        return None
    if len(sweep.classes) != count:
        raise InputError(f"sweep of {len(sweep.classes)} classes, expected {count}")
    classes = np.frombuffer(sweep.classes, np.uint8)
    if classes.max() >= len(CLASSES):
        raise InputError(f"sweep with class {classes.max()}, expected 0 to {len(CLASSES) - 1}")
    return classes


def inputs_digest(written: Sequence[bytes]) -> str:
    """Hash of a decision's inputs as they are logged: sweeps, pose, goal, prediction."""
    digest = hashlib.blake2b(digest_size=16)
    for data in written:
        digest.update(data)
    return digest.hexdigest()


def serialized(message: Message) -> bytes:
    """A message as it is logged and hashed."""
    return message.SerializeToString(deterministic=True)


def _pose(message: pb.Pose) -> Pose:
    trail = None
    try:
        if message.history_period_s:
            trail = Trail(
                np.array(message.history_positions).reshape(-1, 3),
                np.array(message.history_quaternions).reshape(-1, 4),
                message.history_period_s,
            )
    except ValueError as error:
        raise InputError(f"pose: {error}") from None
    position, quaternion = np.array(message.position), np.array(message.quaternion)
    check_pose(position, quaternion, message.position_sigma, trail)
    quaternion = unit_quaternion(quaternion)
    return Pose(
        position,
        quaternion,
        message.position_sigma,
        trail,
        message.heading_sigma,
        covariance_of(message),
        unheld_of(message),
    )


class StatesCovariance(Protocol):
    """Messages with the covariance that an estimator states: `Pose`, `Observation`."""

    @property
    def covariance(self) -> Sequence[float]:
        """16 numbers, or none."""

    @property
    def unheld(self) -> Sequence[float]:
        """3 numbers for each direction that the sweeps do not hold."""


def covariance_of(message: StatesCovariance) -> NDArray[np.float64] | None:  # (4, 4)
    """The stated covariance of x, y, z and heading; none if there is none.

    Raises:
        InputError: It is no 16 finite numbers, not symmetric, or has a negative variance.
    """
    if not message.covariance:
        return None
    values = np.array(message.covariance)
    if values.size != 16 or not (np.abs(values) <= MAX_VARIANCE).all():  # also refuses NaN
        raise InputError(
            f"pose: covariance of {values.size} numbers, expected 16, each within {MAX_VARIANCE:g}"
        )
    covariance = values.reshape(4, 4)
    if (np.abs(covariance - covariance.T) > ASYMMETRY * np.abs(covariance).max()).any() or (
        np.diagonal(covariance) < 0.0
    ).any():
        raise InputError("pose: covariance, expected a symmetric matrix of variances of 0 or more")
    return covariance


def unheld_of(message: StatesCovariance) -> NDArray[np.float64]:  # (k, 3)
    """Directions that the sweeps do not hold.

    Raises:
        InputError: They are not up to 3 of 3 numbers from -1 to 1.
    """
    if not message.unheld:
        return NONE_UNHELD
    values = np.array(message.unheld)
    if values.size not in (3, 6, 9) or not (np.abs(values) <= 1.0 + UNIT_LENGTH).all():
        raise InputError(f"pose: unheld of {values.size} numbers, expected unit vectors of 3")
    return values.reshape(-1, 3)


def _goal(message: pb.Goal) -> NDArray[np.float64]:  # (3,) m
    goal = np.array(message.position)
    if goal.shape != (3,) or not (np.abs(goal) <= MAX_COORDINATE).all():
        raise InputError(f"goal: got {goal}, expected 3 numbers within {MAX_COORDINATE:g} m")
    return goal


def unit_quaternion(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:  # (4,)
    """A quaternion scaled to unit length, or unchanged if it has it to rounding."""
    length = np.sqrt(np.square(quaternion).sum())
    if abs(length - 1.0) <= UNIT_LENGTH:
        return quaternion
    scaled: NDArray[np.float64] = quaternion / length
    return scaled


def check_pose(
    position: NDArray[np.float64],
    quaternion: NDArray[np.float64],
    sigma: float,
    trail: Trail | None,
) -> None:
    """Refuse an invalid pose before a kernel computes array indices from it.

    Raises:
        InputError: A number is out of range; the message names it.
    """
    if position.shape != (3,) or quaternion.shape != (4,):
        raise InputError(f"pose: got {len(position)} and {len(quaternion)} numbers, expected 3, 4")
    positions, quaternions = position[None], quaternion[None]
    if trail is not None:
        positions = np.concatenate([positions, trail.positions])
        quaternions = np.concatenate([quaternions, trail.quaternions])
    if not (np.abs(positions) <= MAX_COORDINATE).all():
        raise InputError(f"pose: position {position}, expected within {MAX_COORDINATE:g} m")
    small = bool((np.abs(quaternions) < 2.0).all())  # the square of a huge number is none
    if not small or (np.abs(np.sqrt(np.square(quaternions).sum(axis=1)) - 1.0) > 1e-3).any():
        raise InputError(f"pose: quaternion {quaternion}, expected unit length")
    if not 0.0 <= sigma <= MAX_COORDINATE:
        raise InputError(f"pose: sigma {sigma:g} m, expected 0 or more")


def beams_from_info(info: pb.SensorInfo) -> Beams:
    """Rebuild a sensor's beams from its logged tables.

    Raises:
        InputError: The tables are invalid.
    """
    width = info.row_width if info.order != "list" else 2  # of no rows
    if width not in (1, 2) or len(info.rows) % width or len(info.columns) % width:
        raise InputError(f"sensor '{info.name}': beam tables of width {width}, expected 1 or 2")
    if not 0.0 < info.rate_hz < np.inf:
        raise InputError(f"sensor '{info.name}': rate {info.rate_hz:g} Hz, expected more than 0")
    try:
        table = BeamTable(
            rows=np.array(info.rows).reshape(-1, width),
            columns=np.array(info.columns).reshape(-1, width),
            beams=info.beams,
            order=info.order,  # type: ignore[arg-type]  # the table checks it
            row_step=info.row_step,
            column_step=info.column_step,
            scan_poses=info.scan_poses,
            measures=info.measures,  # type: ignore[arg-type]
        )
    except ValueError as error:
        raise InputError(f"sensor '{info.name}': {error}") from None
    position, rotation = np.array(info.position_base_sensor), np.array(info.rotation_base_sensor)
    if position.shape != (3,) or rotation.shape != (9,):
        raise InputError(f"sensor '{info.name}': no mounting")
    R = rotation.reshape(3, 3)
    orthogonal = np.allclose(turn(R[None], R)[0], np.eye(3), atol=1e-6)
    if not (np.abs(position) <= MAX_COORDINATE).all() or not orthogonal:
        raise InputError(f"sensor '{info.name}': no mounting")
    longest = LONGEST_LISTED_RANGE if table.listed else LONGEST_RANGE
    if not 0.0 < info.range_m <= longest:
        raise InputError(
            f"sensor '{info.name}': range {info.range_m:g} m, expected up to {longest:g} m"
        )
    return Beams(table, info.range_m, info.rate_hz, position, rotation.reshape(3, 3))


def decode_ranges(sweep: pb.Sweep) -> Ranges:  # (rows * columns,)
    """The ranges of a sweep, mm.

    Raises:
        InputError: Unknown codec, or not the right number of bytes for each beam.
    """
    count = check_count(sweep)
    if sweep.codec == WIDE_CODEC:
        return read_ranges(sweep)
    if sweep.codec != CODEC:
        raise InputError(f"sweep codec '{sweep.codec}', expected '{CODEC}' or '{WIDE_CODEC}'")
    if len(sweep.ranges) != 2 * count:
        raise InputError(f"sweep of {len(sweep.ranges)} bytes, expected {2 * count}")
    return range_codec.decode(sweep.ranges, sweep.rows)
