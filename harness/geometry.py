"""Angles, yaw and polyline lengths, rounded alike on every processor; boxes of cells."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.elementary import arc_tangent

Array = NDArray[np.float64]


def wrap_angle(angle: float) -> float:
    """Return the equal angle in [-pi, pi), rad."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


def atan2_rounded(y: float, x: float) -> float:
    """Return the angle of a direction in the plane, rad, in whole nanoradians.

    The arc tangent of a C library varies in its last bits between processors; this one does not.
    """
    return round(arc_tangent(y, x), 9)


def yaw_of_quaternion(quaternion: Array) -> float:
    """Return the yaw of an orientation (4,), w x y z, rad, in whole nanoradians."""
    w, x, y, z = quaternion.tolist()
    return atan2_rounded(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def polyline_length(points: Array) -> float:
    """Return the length of a polyline (n, d), m; 0 for less than two points."""
    return float(np.sqrt(np.square(np.diff(points, axis=0)).sum(axis=1)).sum())


def least_box(held: NDArray[np.bool_]) -> tuple[slice, ...]:
    """Return the least box of a grid with all cells that are held; one cell without any."""
    parts = []
    for axis in range(held.ndim):
        others = tuple(other for other in range(held.ndim) if other != axis)
        some = np.flatnonzero(held.any(axis=others))
        parts.append(slice(int(some[0]), int(some[-1]) + 1) if len(some) else slice(0, 1))
    return tuple(parts)
