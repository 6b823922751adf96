"""What a decision may see: poses and sweeps exactly as they stand in the log."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass

import numpy as np
from google.protobuf.message import Message
from numpy.typing import NDArray

from harness.errors import InputError
from harness.schema import wayproof_pb2 as pb
from models.beams import beam_directions, rotate

CODEC = "u16-delta-planes"


@dataclass(frozen=True)
class Pose:
    """The believed pose T_world_base.

    Attributes:
        position: (3,) m.
        quaternion: (4,) w x y z.
        position_sigma: One standard deviation on each horizontal axis, m.
    """

    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    position_sigma: float

    @property
    def heading(self) -> float:
        """Yaw, rad."""
        w, x, y, z = self.quaternion
        return heading_of(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


@dataclass(frozen=True)
class Beams:
    """One sensor's geometry, rebuilt from its logged tables.

    Attributes:
        directions: (n, 3) unit vectors, sensor frame.
        range: Longest measured distance, m.
        position_base_sensor: (3,) m.
        R_base_sensor: (3, 3).
    """

    directions: NDArray[np.float64]
    range: float
    position_base_sensor: NDArray[np.float64]
    R_base_sensor: NDArray[np.float64]

    def at(self, pose: Pose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Origin (3,) and directions (n, 3) in the world for a body at `pose`."""
        R_world_base = rotation_matrix(pose.quaternion)
        origin = pose.position + rotate(R_world_base, self.position_base_sensor[None])[0]
        R_world_sensor = rotate(R_world_base, self.R_base_sensor.T).T
        return origin, rotate(R_world_sensor, self.directions)


@dataclass(frozen=True)
class SweepInput:
    """One sweep: the sensor's name and (n,) uint16 millimetres."""

    sensor: str
    ranges_mm: NDArray[np.uint16]


@dataclass(frozen=True)
class Inputs:
    """All that a decision may depend on besides the decisions before it.

    Attributes:
        time_ns: Simulated time of the sweeps.
        sequence: Number of the decision.
        pose: Believed pose at that time.
        sweeps: In the order in which they are integrated.
        digest: Hash of the messages that these were read from.
    """

    time_ns: int
    sequence: int
    pose: Pose
    sweeps: tuple[SweepInput, ...]
    digest: str


def heading_of(y: float, x: float) -> float:
    """Angle of a direction in the plane, rad, in whole nanoradians.

    The last bits of an arc tangent vary between processors; a replay must not.
    """
    return round(math.atan2(y, x), 9)


def rotation_matrix(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation (3, 3) of a unit quaternion w x y z; products and sums only."""
    w, x, y, z = (float(value) for value in quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def inputs_from_messages(pose: pb.Pose, sweeps: list[pb.Sweep]) -> Inputs:
    """Read the inputs of one decision back from its messages.

    The recording itself goes this way too, so that it decides on what the log holds.

    Raises:
        InputError: A sweep's codec or size is not what it says.
    """
    digest = hashlib.blake2b(digest_size=16)
    messages: list[Message] = [*sweeps, pose]
    for message in messages:
        digest.update(message.SerializeToString(deterministic=True))
    return Inputs(
        time_ns=pose.timestamp.ToNanoseconds(),
        sequence=pose.sequence,
        pose=Pose(np.array(pose.position), np.array(pose.quaternion), pose.position_sigma),
        sweeps=tuple(SweepInput(sweep.sensor, decode_ranges(sweep)) for sweep in sweeps),
        digest=digest.hexdigest(),
    )


def beams_from_info(info: pb.SensorInfo) -> Beams:
    """Rebuild a sensor's beams from its logged tables."""
    width = info.row_width
    if width not in (1, 2) or len(info.rows) % width or len(info.columns) % width:
        raise InputError(f"sensor '{info.name}': beam tables of width {width}, expected 1 or 2")
    directions = beam_directions(
        np.array(info.rows).reshape(-1, width), np.array(info.columns).reshape(-1, width)
    )
    return Beams(
        directions=directions,
        range=info.range_m,
        position_base_sensor=np.array(info.position_base_sensor),
        R_base_sensor=np.array(info.rotation_base_sensor).reshape(3, 3),
    )


def encode_ranges(ranges_mm: NDArray[np.uint16], rows: int) -> bytes:
    """Differences along each row, low bytes before high bytes: what zstd then packs well."""
    image = ranges_mm.reshape(rows, -1)
    difference = np.diff(image, axis=1, prepend=np.uint16(0))  # wraps, and unwraps in decoding
    return difference.astype("<u2").reshape(-1, 1).view(np.uint8).T.tobytes()


def decode_ranges(sweep: pb.Sweep) -> NDArray[np.uint16]:  # (rows * columns,)
    """Undo `encode_ranges`.

    Raises:
        InputError: Unknown codec, or not two bytes for each beam.
    """
    count = sweep.rows * sweep.columns
    if sweep.codec != CODEC:
        raise InputError(f"sweep codec '{sweep.codec}', expected '{CODEC}'")
    if len(sweep.ranges) != 2 * count:
        raise InputError(f"sweep of {len(sweep.ranges)} bytes, expected {2 * count}")
    planes = np.frombuffer(sweep.ranges, np.uint8).reshape(2, count)
    difference = planes[0].astype(np.uint16) | (planes[1].astype(np.uint16) << np.uint16(8))
    image = difference.reshape(sweep.rows, sweep.columns)
    return np.cumsum(image, axis=1, dtype=np.uint16).reshape(-1)
