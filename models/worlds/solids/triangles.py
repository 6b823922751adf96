"""Exact distances from points to triangles, in space or in the plane."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

BOX_FACES = np.array(
    [
        (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
        (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
    ]
)  # fmt: skip
"""Triangles (12, 3) of a box whose corners are numbered with x slowest and z fastest."""


def distance_to_triangles(
    points: ArrayLike, triangles: NDArray[np.float64]
) -> NDArray[np.float64]:  # (n,)
    """Return the distance from points to the nearest of the triangles, m; infinite without any.

    Args:
        points: (n, d) with d = 2 or 3.
        triangles: (m, 3, d) corners.
    """
    points = np.asarray(points, np.float64)
    least = np.full(len(points), np.inf)
    for triangle in triangles:
        np.minimum(least, _squared_distance(points, triangle), out=least)
    return np.asarray(np.sqrt(least))


def _squared_distance(
    points: NDArray[np.float64], triangle: NDArray[np.float64]
) -> NDArray[np.float64]:  # (n,)
    """Return the squared distance to the plane if its foot is inside, else to the nearest side."""
    a, b, c = triangle
    sides = [_to_segment(points, p, q) for p, q in ((a, b), (b, c), (c, a))]
    least: NDArray[np.float64] = np.minimum(np.minimum(sides[0], sides[1]), sides[2])
    u, v, offset = b - a, c - a, points - a
    uu, uv, vv = u @ u, u @ v, v @ v
    determinant = uu * vv - uv * uv
    if determinant <= 0.0:
        return least  # the corners lie on one line
    ou, ov = offset @ u, offset @ v
    s, t = (vv * ou - uv * ov) / determinant, (uu * ov - uv * ou) / determinant
    inside = (s >= 0.0) & (t >= 0.0) & (s + t <= 1.0)
    perpendicular = offset - s[:, None] * u - t[:, None] * v
    return np.where(inside, np.square(perpendicular).sum(axis=1), least)


def _to_segment(
    points: NDArray[np.float64], tail: NDArray[np.float64], head: NDArray[np.float64]
) -> NDArray[np.float64]:  # (n,) squared
    along = head - tail
    offset = points - tail
    length = max(float(along @ along), 1e-300)
    share = np.clip(offset @ along / length, 0.0, 1.0)
    nearest: NDArray[np.float64] = np.square(offset - share[:, None] * along).sum(axis=1)
    return nearest
