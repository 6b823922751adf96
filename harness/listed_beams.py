"""Beams that a sweep of a recording lists, to and from the messages of a log.

A sensor of order `list` has no tables: its sweeps differ in number and direction of beams, and the
beams of one sweep may leave from several poses, as it was taken while the robot moved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.poses import rotation_matrices
from wayproof.models.sensors import codecs
from wayproof.models.sensors.beams import LONGEST_LISTED_RANGE, MAX_BEAMS, NO_RETURN

CODEC = "u16-delta-planes"
WIDE_CODEC = "u32-delta-planes"
"""Codecs of ranges: of 16 bits, and of 32 for ranges that are longer than 65.534 m."""

MOST_POSES = 256
"""Maximum number of poses that the beams of one sweep leave from."""

OLDEST_S = 10.0
"""Maximum age of a pose at which beams leave, s."""

Mount = tuple[NDArray[np.float64], NDArray[np.float64]] | tuple[None, None]
"""T_base_sensor: position (3,), m, and rotation (3, 3); or none."""

LONGEST_MM = round(LONGEST_LISTED_RANGE * 1e3)


@dataclass(frozen=True)
class ListedBeams:
    """Beams of one sweep.

    Attributes:
        directions: (n, 3) unit vectors, sensor frame.
        poses: (n,) int32 index of the pose that each leaves from.
        ages: (m,) age of each of these poses at the time of the decision, s.
        position_base_sensor: (3,) m, of this sweep; None if it is that of the sensor.
        R_base_sensor: (3, 3) likewise.
    """

    directions: NDArray[np.float64]
    poses: NDArray[np.int32]
    ages: NDArray[np.float64]
    position_base_sensor: NDArray[np.float64] | None = None
    R_base_sensor: NDArray[np.float64] | None = None


def write_list(
    message: pb.Sweep,
    directions: NDArray[np.floating],  # (n, 3) unit, sensor frame
    ranges_mm: NDArray[np.uint32],  # (n,) 0: dropped, 65535: no return
    poses: NDArray[np.integer] | None = None,  # (n,) index into the ages
    ages_ns: tuple[int, ...] = (0,),  # of each pose at the time of the message
) -> None:
    """Write beams into a sweep."""
    message.rows, message.columns = 1, len(ranges_mm)
    message.directions = codecs.encode_directions(directions)
    wide = bool((ranges_mm > NO_RETURN).any())
    message.codec = WIDE_CODEC if wide else CODEC
    if wide:
        message.ranges = codecs.encode_ranges(ranges_mm)
    else:
        message.ranges = codecs.encode_image(ranges_mm.astype(np.uint16), 1)
    if ages_ns != (0,):
        message.ages_ns.extend(ages_ns)
    if poses is not None and len(ages_ns) > 1:
        message.beam_poses = poses.astype(np.uint8).tobytes()


def read_list(message: pb.Sweep) -> ListedBeams | None:
    """Read the beams of a sweep; None of a sensor with tables.

    Raises:
        InputError: The beams are not those of a sweep.
    """
    if not message.directions:
        return None
    count = message.rows * message.columns
    try:
        directions = codecs.decode_directions(message.directions, count)
    except ValueError as error:
        raise InputError(f"sweep: {error}") from None
    ages: NDArray[np.float64] = np.array(message.ages_ns or [0], np.float64) * 1e-9
    if len(ages) > MOST_POSES or not ((ages >= 0.0) & (ages <= OLDEST_S)).all():
        raise InputError(
            f"sweep: got {len(ages)} poses, expected at most {MOST_POSES}, 0 to {OLDEST_S:g} s old"
        )
    poses = np.zeros(count, np.int32)
    if message.beam_poses:
        poses = np.frombuffer(message.beam_poses, np.uint8).astype(np.int32)
        if len(poses) != count or poses.max() >= len(ages):
            raise InputError(
                f"sweep: got poses of {len(poses)} beams, expected {count} below {len(ages)}"
            )
    return ListedBeams(directions, poses, ages, *read_mount(message))


def read_ranges(message: pb.Sweep) -> NDArray[np.uint32]:  # (rows * columns,)
    """Read ranges of 32 bits, mm.

    Raises:
        InputError: Not four bytes for each beam, or a range that is too long.
    """
    try:
        ranges = codecs.decode_ranges(message.ranges, message.rows * message.columns)
    except ValueError as error:
        raise InputError(f"sweep: ranges: {error}") from None
    if ranges.max() > LONGEST_MM:
        raise InputError(f"sweep: range {ranges.max()} mm, expected up to {LONGEST_MM}")
    return ranges


def check_count(message: pb.Sweep) -> int:
    """Return the number of beams of a sweep.

    Raises:
        InputError: None, or more than a sweep can have.
    """
    count: int = message.rows * message.columns
    if not 0 < count <= MAX_BEAMS:
        raise InputError(
            f"sweep of {message.rows} x {message.columns} beams, expected 1 to {MAX_BEAMS}"
        )
    return count


def read_mount(message: pb.Sweep) -> Mount:
    """Read T_base_sensor of this sweep; None if it is that of the sensor.

    Raises:
        InputError: The numbers are no mount.
    """
    if not message.mount:
        return None, None
    numbers = np.array(message.mount)
    if numbers.shape != (7,) or not (np.abs(numbers) <= LONGEST_LISTED_RANGE).all():
        raise InputError(f"sweep: a mount of {len(numbers)} numbers, expected 7 within 1000 m")
    length = np.sqrt(np.square(numbers[3:]).sum())
    if not abs(length - 1.0) <= 1e-3:
        raise InputError(f"sweep: mount with quaternion {numbers[3:]}, expected unit length")
    return numbers[:3], rotation_matrices(numbers[None, 3:] / length)[0]
