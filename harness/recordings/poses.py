"""Poses of a recording checked, put in order, and made a track."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.recordings.order import in_order
from wayproof.harness.recordings.recording import Faults, RecordingOptions
from wayproof.harness.recordings.track import RecordedTrack
from wayproof.harness.recordings.types import Transform
from wayproof.maps.elementary import sines_cosines

MAX_COORDINATE = 1e5
"""Maximum distance from the origin along an axis, m: that of the inputs of a decision."""

UNIT_EXACT, UNIT_CLOSE = 1e-14, 0.1
"""Squared length of a quaternion less 1: up to the first it is kept bit by bit, up to the second it
is scaled to unit length; beyond it is no orientation."""

RESET = "pose: jump of the estimator"
"""Fault of poses whose estimator says that it has moved them at once."""


class StampedPoses(NamedTuple):
    """Poses as they were read.

    Attributes:
        stamps_ns: (n,) int64, ns of the recording's clock.
        positions: (n, 3) m.
        quaternions: (n, 4) w x y z.
    """

    stamps_ns: NDArray[np.int64]
    positions: NDArray[np.float64]
    quaternions: NDArray[np.float64]

    def at(self, places: NDArray[np.int64] | NDArray[np.bool_]) -> StampedPoses:
        """Return those at places (k,), or of a mask (n,)."""
        return StampedPoses(
            self.stamps_ns[places], self.positions[places], self.quaternions[places]
        )


def sound(poses: StampedPoses, faults: Faults, what: str = "pose") -> StampedPoses:
    """Return the poses that are finite and within bounds, in order of their stamps.

    Quaternions off unit length are normalised and counted; those far off are left out, and
    counted, with those that are not finite. Faults are counted as those of `what`.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        squares = (poses.quaternions * poses.quaternions).sum(axis=1)
    near = np.abs(poses.positions).max(axis=1, initial=0.0) <= MAX_COORDINATE  # false for NaN
    finite = np.isfinite(poses.positions).all(axis=1) & np.isfinite(squares)
    unit = np.abs(squares - 1.0) <= UNIT_CLOSE  # false for NaN
    faults[f"{what}: not finite"] += int((~finite).sum())
    faults[f"{what}: beyond {MAX_COORDINATE:g} m"] += int((finite & ~near).sum())
    faults[f"{what}: quaternion far from unit length"] += int((finite & near & ~unit).sum())
    kept = poses.at(finite & near & unit)
    squares = squares[finite & near & unit]
    rough = np.abs(squares - 1.0) > 1e-6
    faults[f"{what}: quaternion normalised"] += int(rough.sum())
    inexact = np.abs(squares - 1.0) > UNIT_EXACT
    scaled = kept.quaternions.copy()
    scaled[inexact] /= np.sqrt(squares[inexact])[:, None]
    places = in_order(kept.stamps_ns)
    repeated = int((np.diff(kept.stamps_ns) == 0).sum())
    faults[f"{what}: repeated stamp"] += repeated
    faults[f"{what}: stamp out of order"] += max(len(kept.stamps_ns) - len(places) - repeated, 0)
    return kept._replace(quaternions=scaled).at(places)


def track_of(
    path: Path, poses: StampedPoses, source: str, options: RecordingOptions, faults: Faults
) -> tuple[RecordedTrack, int]:
    """Make a track of poses, and return it with the stamp of its first, ns.

    Raises:
        InputError: No pose is sound.
    """
    good = sound(poses, faults)
    if len(good.stamps_ns) == 0:
        raise InputError(
            f"recording '{path}': no pose of {len(poses.stamps_ns)} from {source} can be used"
        )
    start = int(good.stamps_ns[0])
    if int(good.stamps_ns[-1]) - start >= 2**62:
        raise InputError(f"recording '{path}': stamps of {source} span over 100 years")
    max_gap_ns = round(options.max_gap_s * 1e9)
    times = good.stamps_ns - start
    faults[f"pose: gap of more than {options.max_gap_s:g} s"] += int(
        (np.diff(times) > max_gap_ns).sum()
    )
    track = RecordedTrack(times, good.positions, good.quaternions, source, max_gap_ns)
    return track, start


def planar(places: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return positions (n, 3) and quaternions (n, 4) of planar poses (n, 3): x, y, m, yaw, rad."""
    count = len(places)
    positions, quaternions = np.zeros((count, 3)), np.zeros((count, 4))
    positions[:, :2] = places[:, :2]
    quaternions[:, 3], quaternions[:, 0] = sines_cosines(places[:, 2] / 2.0)
    return positions, quaternions


def mount_of(numbers: Sequence[float]) -> Transform:
    """Return the pose T_body_sensor of `x, y, z[, yaw[, pitch[, roll]]]`, m and degrees.

    The turns are about z, then the new y, then the new x, as of ROS's `static_transform_publisher`.

    Raises:
        InputError: They are not three to six finite numbers.
    """
    if not 3 <= len(numbers) <= 6 or not np.isfinite(numbers).all():
        got = ",".join(f"{number:g}" for number in numbers)
        raise InputError(f"mount {got}: expected X,Y,Z[,YAW[,PITCH[,ROLL]]], in m and degrees")
    turns = Transform(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
    for axis, degrees in zip((3, 2, 1), numbers[3:], strict=False):
        sine, cosine = sines_cosines(np.array([np.radians(degrees) / 2.0]))
        quaternion = np.zeros(4)
        quaternion[0], quaternion[axis] = cosine[0], sine[0]
        turns = compose(turns, Transform(np.zeros(3), quaternion))
    return Transform(np.array(numbers[:3], np.float64), turns.quaternion)


def rotate(quaternion: NDArray[np.float64], vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn vectors (..., 3) by unit quaternions (..., 4)."""
    w, axis = quaternion[..., :1], quaternion[..., 1:]
    across = 2.0 * _cross(axis, vectors)
    turned: NDArray[np.float64] = vectors + w * across + _cross(axis, across)
    return turned


def compose(first: Transform, second: Transform) -> Transform:
    """Return T_a_c of T_a_b and T_b_c; arrays may have a leading axis of equal length."""
    p, q = first
    w1, v1, w2, v2 = q[..., :1], q[..., 1:], second.quaternion[..., :1], second.quaternion[..., 1:]
    w = w1 * w2 - (v1 * v2).sum(axis=-1, keepdims=True)
    v = w1 * v2 + w2 * v1 + _cross(v1, v2)
    return Transform(p + rotate(q, second.position), np.concatenate([w, v], axis=-1))


def inverse(transform: Transform) -> Transform:
    """Return T_b_a of T_a_b."""
    back = transform.quaternion * np.array([1.0, -1.0, -1.0, -1.0])
    return Transform(-rotate(back, transform.position), back)


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    product: NDArray[np.float64] = np.stack(
        [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1
    )
    return product
