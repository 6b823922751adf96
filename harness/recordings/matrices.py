"""Poses written as matrices, and the frames of cameras and lidars that they are of."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.recordings.poses import StampedPoses, compose, inverse, rotate
from wayproof.harness.recordings.recording import Faults
from wayproof.harness.recordings.types import Transform

OPTICAL = Transform(np.zeros(3), np.array([0.5, -0.5, 0.5, -0.5]))
"""T_body_optical, REP 103: of a camera's frame (z ahead, x right) in one with x ahead, z up."""

SKEW = 0.05
"""Greatest difference of R R' from the identity: beyond it a matrix is no rotation."""


def stamped(stamps_ns: list[int], numbers: list[list[float]], faults: Faults) -> StampedPoses:
    """Return poses of matrices (n, 12 or 16), row by row; invalid ones are counted."""
    rows = np.array([row[:12] for row in numbers], np.float64).reshape(-1, 3, 4)
    R = rows[:, :, :3]
    with np.errstate(invalid="ignore", over="ignore"):
        products = (R[:, :, None, :] * R[:, None, :, :]).sum(axis=3)
        minors = np.cross(R[:, 0], R[:, 1])
        good = np.abs(products - np.eye(3)).max(axis=(1, 2), initial=0.0) < SKEW
        good &= (minors * R[:, 2]).sum(axis=1) > 0.0
    good &= np.isfinite(rows).all(axis=(1, 2))
    faults["pose: no rotation"] += int((~good).sum())
    kept = rows[good]
    quaternions = np.array([quaternion_of(one) for one in kept[:, :, :3]]).reshape(-1, 4)
    stamps = np.array(stamps_ns, np.int64)[good]
    return StampedPoses(stamps, kept[:, :, 3], quaternions)


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


def is_camera_world(poses: StampedPoses) -> bool:
    """Return whether the world of a camera's poses (optical frame) has its y down, not its z up.

    The camera's own up is compared with both, at all poses together: datasets say neither.
    """
    up = rotate(poses.quaternions, np.array([0.0, -1.0, 0.0])).sum(axis=0)
    return bool(-up[1] >= up[2])


def of_body(poses: StampedPoses, T_body_frame: Transform, turn_world: bool) -> StampedPoses:
    """Return poses of a body from those of a frame on it.

    Args:
        poses: T_world_frame.
        T_body_frame: Place of the frame on the body.
        turn_world: Whether the world's frame is turned as the frame is on the body, too: where the
            poses are relative to the first one, the world is then one with z up.
    """
    moved = compose(Transform(poses.positions, poses.quaternions), inverse(T_body_frame))
    if turn_world:
        moved = compose(T_body_frame, moved)
    return poses._replace(positions=moved.position, quaternions=moved.quaternion)
