"""Prisms over outlines in the plane, in convex pieces: triangulated by GEOS."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_files.parts import Mesh

MAX_CORNERS = 2000
"""Maximum number of corners of all outlines together."""


def prisms(outlines: Sequence[NDArray[np.float64]], height: float) -> list[Mesh]:
    """Return convex prisms from z = 0 to a height that fill outlines exactly.

    A point is filled if an odd number of outlines is around it: one in another is a hole.

    Args:
        outlines: (n, 2) corners of each in order, m; the last may repeat the first.
        height: m.

    Raises:
        ValueError: Fewer than three corners, too many, or outlines that cross themselves or others.
        ImportError: Shapely is not installed.
    """
    import shapely

    counts = [len(np.unique(outline, axis=0)) for outline in outlines]
    for count in (*counts, sum(counts)):
        if not 3 <= count <= MAX_CORNERS:
            raise ValueError(f"got {count} corners, expected 3 to {MAX_CORNERS}")
    polygons = [shapely.Polygon(outline) for outline in outlines]
    if not all(polygon.is_valid for polygon in polygons):
        raise ValueError("an outline that crosses itself, expected a simple one")
    if any(one.overlaps(other) for one, other in itertools.combinations(polygons, 2)):
        raise ValueError("outlines that cross, expected each around or beside the others")
    filled = functools.reduce(shapely.symmetric_difference, polygons)
    triangles = shapely.constrained_delaunay_triangles(filled).geoms
    return [_prism(np.array(triangle.exterior.coords)[:3], height) for triangle in triangles]


def _prism(corners: NDArray[np.float64], height: float) -> Mesh:
    """Return the prism over a triangle (3, 2)."""
    (ax, ay), (bx, by), (cx, cy) = corners
    if (bx - ax) * (cy - ay) < (by - ay) * (cx - ax):
        corners = corners[::-1]
    low = np.column_stack([corners, np.zeros(3)])
    vertices = np.vstack([low, low + np.array([0.0, 0.0, height])])
    sides = [(n, m, m + 3) for n, m in ((0, 1), (1, 2), (2, 0))]
    sides += [(n, m + 3, n + 3) for n, m in ((0, 1), (1, 2), (2, 0))]
    return Mesh(vertices, np.array([(0, 2, 1), (3, 4, 5), *sides], np.int64))
