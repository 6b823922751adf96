"""Messages of a decision's inputs: read back, checked and hashed."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Protocol

import numpy as np
from google.protobuf.message import Message
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.inputs import NONE_UNHELD, Beams, Inputs, Pose, SweepInput, turn
from wayproof.harness.listed_beams import (
    CODEC,
    WIDE_CODEC,
    check_count,
    read_list,
    read_mount,
    read_ranges,
)
from wayproof.harness.prediction.predicted_box import read_prediction
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.maps.sweep import Ranges
from wayproof.models.classes import CLASSES
from wayproof.models.poses import Trail
from wayproof.models.sensors import codecs
from wayproof.models.sensors.beams import LONGEST_LISTED_RANGE, LONGEST_RANGE, BeamTable

MAX_COORDINATE = 1e5
"""Maximum distance from the world's origin along an axis, m; beyond any mission."""

MAX_VARIANCE = 1e12
"""Greatest variance of a pose, m^2 and rad^2."""

ASYMMETRY = 1e-9
"""Share of its largest entry by which rounding may leave a covariance asymmetric."""

UNIT_LENGTH = 1e-9
"""Difference from unit length beyond which a quaternion is scaled to it."""


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
        sweeps: Sweeps in the order in which they are integrated.
        written: Sweeps, pose, goal and prediction serialized, if that is done already.
        goal: Goal of this decision; of recordings, and of missions with several goals.
        prediction: Prediction of a predictor from outside before this decision.

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
                sensor=sweep.sensor,
                ranges_mm=decode_ranges(sweep),
                classes=decode_classes(sweep),
                beams=read_list(sweep),
                mount=read_mount(sweep),
                age_ns=sweep.age_ns,
                lag=sweep.lag,
            )
            for sweep in sweeps
        ),
        digest=inputs_digest(written),
        goal=None if goal is None else _goal(goal),
        goals_reached=0 if goal is None else goal.index,
        prediction=None if prediction is None else read_prediction(prediction),
    )


def decode_ranges(sweep: pb.Sweep) -> Ranges:  # (rows * columns,)
    """Return the ranges of a sweep, mm.

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
    return codecs.decode_image(sweep.ranges, sweep.rows)


def decode_classes(sweep: pb.Sweep) -> NDArray[np.uint8] | None:  # (rows * columns,)
    """Return the class of the surface that each beam hit; None without semantics.

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
    """Return the hash of a decision's inputs as they are logged: sweeps, pose, goal, prediction."""
    digest = hashlib.blake2b(digest_size=16)
    for data in written:
        digest.update(data)
    return digest.hexdigest()


def serialized(message: Message) -> bytes:
    """Return a message as it is logged and hashed."""
    return message.SerializeToString(deterministic=True)


def _pose(message: pb.Pose) -> Pose:
    """Return the pose of a message, its quaternion scaled to unit length.

    Raises:
        InputError: A number is missing or out of range.
    """
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
        position=position,
        quaternion=quaternion,
        position_sigma=message.position_sigma,
        trail=trail,
        heading_sigma=message.heading_sigma,
        covariance=covariance_of(message),
        unheld=unheld_of(message),
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
    """Return the stated covariance of x, y, z and heading; None if not stated.

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
    """Return directions that the sweeps do not hold.

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
    """Return a quaternion scaled to unit length, or unchanged if it has it to rounding."""
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
    return Beams(table, info.range_m, info.rate_hz, position, R_base_sensor=rotation.reshape(3, 3))
