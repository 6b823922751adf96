"""Small vectors, rotations and parameters, in the form that kernels of controllers take."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel
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


def packed(parameters: Any, **more: Any) -> NDArray[Any]:
    """Return a named tuple of numbers, tuples of numbers and named tuples as one record, (1,).

    Args:
        parameters: The named tuple.
        more: Further fields by name.
    """
    fields = {**parameters._asdict(), **more}
    dtype = _record_type(tuple((name, *_field(value)) for name, value in fields.items()))
    return np.array([tuple(fields.values())], dtype)


@functools.cache
def _record_type(fields: tuple[tuple[Any, ...], ...]) -> np.dtype[Any]:
    """Return the type of a record, the same object each time.

    A kernel that is called with an equal one compares all fields first.
    """
    return np.dtype([*fields], align=True)


def _field(value: Any) -> tuple[Any, tuple[int, ...]]:
    """Return the type and shape of a field."""
    if hasattr(value, "_fields"):
        return packed(value).dtype, ()
    array = np.array(value)
    return array.dtype, array.shape
