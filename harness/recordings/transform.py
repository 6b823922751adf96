"""Poses of one frame in another, and what is computed with them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.maps.elementary import sines_cosines


class Transform(NamedTuple):
    """A pose of one frame in another, or several.

    Attributes:
        position: (3,) or (n, 3) m.
        quaternion: (4,) or (n, 4) w x y z, unit length.
    """

    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]

    def row(self, k: int) -> Transform:
        """Return the k-th of several."""
        return Transform(self.position[k], self.quaternion[k])


IDENTITY = Transform(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))

OPTICAL = Transform(np.zeros(3), np.array([0.5, -0.5, 0.5, -0.5]))
"""T_body_optical, REP 103: of a camera's frame (z ahead, x right) in one with x ahead, z up."""


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


def planar(places: NDArray[np.float64]) -> Transform:
    """Return the poses of planar ones (n, 3): x, y, m, and yaw, rad."""
    positions, quaternions = np.zeros((len(places), 3)), np.zeros((len(places), 4))
    positions[:, :2] = places[:, :2]
    quaternions[:, 3], quaternions[:, 0] = sines_cosines(places[:, 2] / 2.0)
    return Transform(positions, quaternions)


def quaternion_of(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unit quaternion (4,), w x y z, of a rotation (3, 3), nearly orthogonal.

    From the greatest of the four components (Shepperd, "Quaternion from rotation matrix", 1978).
    """
    (a, b, c), (d, e, f), (g, h, i) = R.tolist()
    squares = np.array([1 + a + e + i, 1 + a - e - i, 1 - a + e - i, 1 - a - e + i])
    rows = (
        [squares[0], h - f, c - g, d - b],
        [h - f, squares[1], b + d, c + g],
        [c - g, b + d, squares[2], f + h],
        [d - b, c + g, f + h, squares[3]],
    )
    row = np.array(rows[int(np.argmax(squares))])
    unit: NDArray[np.float64] = row / np.sqrt((row * row).sum())
    return unit if unit[0] >= 0.0 else -unit


def mount_of(numbers: Sequence[float]) -> Transform:
    """Return the pose T_body_sensor of `x, y, z[, yaw[, pitch[, roll]]]`, m and degrees.

    The turns are about z, then the new y, then the new x, as of ROS's `static_transform_publisher`.

    Raises:
        InputError: They are not three to six finite numbers.
    """
    if not 3 <= len(numbers) <= 6 or not np.isfinite(numbers).all():
        got = ",".join(f"{number:g}" for number in numbers)
        raise InputError(f"mount {got}: expected X,Y,Z[,YAW[,PITCH[,ROLL]]], in m and degrees")
    turns = IDENTITY
    for axis, degrees in zip((3, 2, 1), numbers[3:], strict=False):
        sine, cosine = sines_cosines(np.array([np.radians(degrees) / 2.0]))
        quaternion = np.zeros(4)
        quaternion[0], quaternion[axis] = cosine[0], sine[0]
        turns = compose(turns, Transform(np.zeros(3), quaternion))
    return Transform(np.array(numbers[:3], np.float64), turns.quaternion)


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    product: NDArray[np.float64] = np.stack(
        [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1
    )
    return product
