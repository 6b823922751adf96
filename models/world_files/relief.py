"""Meshes of ground: a surface with one height at each place, as a height field."""

from __future__ import annotations

from math import ceil

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_files.parts import Mesh, Part

LEAST_WIDTH = 4.0
"""Width in x and y from which a mesh may be ground, m."""

MAX_NODES = 700
"""Number of heights along a side; more make a world file of many MiB."""

GROUND_DEPTH = 0.5
"""Depth of the ground below the lowest height, m."""

LEAST_COVER = 0.995
"""Share of the bounding rectangle that the surface has to cover: a height field has no holes."""


def relief_part(mesh: Mesh) -> tuple[Part, float] | None:
    """Return a mesh as a height field of kind `floor`, and its greatest error in height, m.

    None where the mesh is not such a surface: all triangles face up, or all down, they cover a
    rectangle, and none covers another.
    """
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    width = high - low
    if width[:2].min() < LEAST_WIDTH or width[2] <= 0.0:
        return None
    a, b, c = (mesh.vertices[mesh.faces[:, n]] for n in range(3))
    areas = np.cross(b - a, c - a)[:, 2] / 2.0  # signed, seen from above
    if not ((areas >= 0.0).all() or (areas <= 0.0).all()):
        return None
    covered = float(np.abs(areas).sum()) / float(width[0] * width[1])
    if not LEAST_COVER <= covered <= 1.0 + 1e-6:
        return None
    edge = float(np.sqrt(2.0 * np.median(np.abs(areas[areas != 0.0]))))
    counts = [int(np.clip(ceil(w / max(edge, 1e-9)) + 1, 2, MAX_NODES)) for w in width[:2]]
    heights = _heights(mesh, counts)
    if heights is None:
        return None
    error = _error(mesh, heights)
    rise = float(np.ptp(heights))
    if rise <= 0.0:
        return None
    half_x, half_y = width[:2] / 2.0
    part = Part(
        "heights", (float(half_x), float(half_y), rise, GROUND_DEPTH),
        (float(low[0] + half_x), float(low[1] + half_y), float(heights.min())), kind="floor",
        heights=(heights - heights.min()) / rise,
    )  # fmt: skip
    return part, error


def _heights(mesh: Mesh, counts: list[int]) -> NDArray[np.float64] | None:  # (ny, nx)
    """Return the surface's height at nodes of a grid over its bounds; None if nodes lie bare."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    nx, ny = counts
    step = (high[:2] - low[:2]) / (nx - 1, ny - 1)
    heights = np.full((ny, nx), np.nan)
    for triangle in mesh.vertices[mesh.faces]:
        at = (triangle[:, :2] - low[:2]) / step
        first = np.ceil(at.min(axis=0) - 1e-6).astype(int).clip(0)
        last = np.floor(at.max(axis=0) + 1e-6).astype(int).clip(None, (nx - 1, ny - 1))
        if (last < first).any():
            continue
        x, y = np.meshgrid(np.arange(first[0], last[0] + 1), np.arange(first[1], last[1] + 1))
        (u, v), inside = _barycentric(at, x, y)
        z = triangle[0, 2] + u * (triangle[1, 2] - triangle[0, 2])
        z = z + v * (triangle[2, 2] - triangle[0, 2])
        heights[y[inside], x[inside]] = z[inside]
    if np.isnan(heights).any():
        return None
    return heights


def _barycentric(
    at: NDArray[np.float64], x: NDArray[np.int64], y: NDArray[np.int64]
) -> tuple[tuple[NDArray[np.float64], NDArray[np.float64]], NDArray[np.bool_]]:
    """Return shares of a triangle's second and third corner at places, and which lie in it."""
    (ax, ay), (bx, by), (cx, cy) = at
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    if area == 0.0:
        nothing = np.zeros(x.shape)
        return (nothing, nothing), np.zeros(x.shape, np.bool_)
    u = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / area
    v = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / area
    return (u, v), (u >= -1e-6) & (v >= -1e-6) & (u + v <= 1.0 + 1e-6)


def _error(mesh: Mesh, heights: NDArray[np.float64]) -> float:
    """Return the greatest difference in height at the mesh's own vertices, m."""
    from scipy.interpolate import RegularGridInterpolator

    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    ny, nx = heights.shape
    axes = (np.linspace(low[1], high[1], ny), np.linspace(low[0], high[0], nx))
    field = RegularGridInterpolator(axes, heights, bounds_error=False, fill_value=None)
    found = field(mesh.vertices[:, [1, 0]])
    return float(np.abs(found - mesh.vertices[:, 2]).max())
