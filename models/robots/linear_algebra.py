"""Small vectors and rotations, for the kernels of controllers."""

from __future__ import annotations

from wayproof.models._jit import kernel
from wayproof.models.arrays import Array


@kernel
def rotation_from_quaternion(quaternion: Array, R: Array) -> None:
    """Write the rotation (3, 3) of a unit quaternion wxyz (4,)."""
    w, x, y, z = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    R[0, 0], R[0, 1], R[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


@kernel
def rotate(R: Array, vector: Array, rotated: Array) -> None:
    """Write R (3, 3) times a vector (3,)."""
    for i in range(3):
        rotated[i] = R[i, 0] * vector[0] + R[i, 1] * vector[1] + R[i, 2] * vector[2]


@kernel
def dot(a: Array, b: Array) -> float:
    """Return a . b of two vectors (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]  # type: ignore[no-any-return]


@kernel
def cross(a: Array, b: Array, product: Array) -> None:
    """Write a x b of two vectors (3,)."""
    product[0] = a[1] * b[2] - a[2] * b[1]
    product[1] = a[2] * b[0] - a[0] * b[2]
    product[2] = a[0] * b[1] - a[1] * b[0]


@kernel
def add_cross(start: Array, a: Array, b: Array, total: Array) -> None:
    """Write start + a x b of three vectors (3,)."""
    total[0] = start[0] + a[1] * b[2] - a[2] * b[1]
    total[1] = start[1] + a[2] * b[0] - a[0] * b[2]
    total[2] = start[2] + a[0] * b[1] - a[1] * b[0]
