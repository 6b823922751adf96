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

INSET = 1e-9
"""Share of the width by which the outermost nodes lie within the surface, not beside it."""


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
    from matplotlib.tri import LinearTriInterpolator, Triangulation

    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    x, y, z = mesh.vertices.T
    inset = INSET * (high - low)
    nodes = [np.linspace(low[n] + inset[n], high[n] - inset[n], counts[n]) for n in range(2)]
    try:
        heights = LinearTriInterpolator(Triangulation(x, y, mesh.faces), z)(*np.meshgrid(*nodes))
    except (RuntimeError, ValueError):  # such as of steps, whose sides no place lies in
        return None
    return None if np.ma.getmaskarray(heights).any() else np.asarray(heights, np.float64)


def _error(mesh: Mesh, heights: NDArray[np.float64]) -> float:
    """Return the greatest difference in height at the mesh's own vertices, m."""
    from scipy.interpolate import RegularGridInterpolator

    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    ny, nx = heights.shape
    axes = (np.linspace(low[1], high[1], ny), np.linspace(low[0], high[0], nx))
    field = RegularGridInterpolator(axes, heights, bounds_error=False, fill_value=None)
    found = field(mesh.vertices[:, [1, 0]])
    return float(np.abs(found - mesh.vertices[:, 2]).max())
