"""Convex meshes: hulls, how far a surface is from its hull, and prisms over outlines."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_files.parts import Mesh, axes_of

if TYPE_CHECKING:
    import shapely

EXACT = 1e-4
"""Share of the size up to which a surface that deviates from its hull is that hull."""

SPACING, MOST_POINTS = 0.025, 200
"""Distance between the points that surfaces are compared by, m, and their number along one."""

DEEP = 0.3
"""Depth of a surface below its hull from which no more than that is measured, m."""

TILT, MOST_AXES = 1e-3, 6
"""Deviation from a right angle and of areas, as a share, and number of directions in which a prism
is looked for."""

MAX_CORNERS = 2000
"""Maximum number of corners of all outlines together."""


def hull(points: NDArray[np.float64]) -> Mesh | None:
    """Return the convex hull of points (n, 3); None where they lie in a plane."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        found = ConvexHull(points)
    except (QhullError, ValueError):
        return None
    inner = points[found.vertices].mean(axis=0)
    a, b, c = (points[found.simplices[:, n]] for n in range(3))
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a - inner) > 0.0
    faces = np.where(outward[:, None], found.simplices, found.simplices[:, ::-1])
    used, own = np.unique(faces, return_inverse=True)
    return Mesh(points[used], own.reshape(-1, 3).astype(np.int64))


def distance_to_hull(mesh: Mesh, around: Mesh) -> float:
    """Return about the greatest distance between a surface and its hull, m; 0 if they are one.

    The depth of a vertex or of the middle of a triangle is a bound from below. Where it is small,
    as it is for a box without its lid, points on both surfaces are compared; what is far off a
    large mesh is infinitely far.
    """
    from scipy.spatial import ConvexHull, cKDTree

    size = float(np.ptp(mesh.vertices, axis=0).max())
    points = np.concatenate([mesh.vertices, mesh.vertices[mesh.faces].mean(axis=1)])
    depths = np.full(len(points), np.inf)
    for plane in np.unique(ConvexHull(around.vertices).equations, axis=0):
        np.minimum(depths, -(points @ plane[:3] + plane[3]), out=depths)
    sunk = float(depths.max())
    areas = [float(_areas(one).sum()) for one in (mesh, around)]
    if sunk <= EXACT * size and abs(areas[0] - areas[1]) <= 1e-3 * areas[1]:
        return 0.0
    spacing = max(SPACING, size / MOST_POINTS)
    if sunk > DEEP:
        return sunk
    ours, theirs = (surface_points(one, spacing) for one in (mesh, around))
    most = 4.0 * spacing if size > 2.0 * DEEP else np.inf  # what is farther costs minutes
    return max(
        float(cKDTree(near).query(points, distance_upper_bound=most)[0].max())
        for near, points in ((ours, theirs), (theirs, ours))
    )


def surface_points(mesh: Mesh, spacing: float) -> NDArray[np.float64]:  # (n, 3)
    """Return points on the triangles of a mesh, no farther apart along edges than a spacing, m."""
    a, b, c = (mesh.vertices[mesh.faces[:, n]] for n in range(3))
    longest = np.max([np.linalg.norm(q - p, axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    counts = np.ceil(longest / spacing).astype(int).clip(1)
    points = []
    for count in np.unique(counts):
        chosen = np.flatnonzero(counts == count)
        i, j = np.indices((count + 1, count + 1)).reshape(2, -1)
        u, v = (w[i + j <= count, None] / count for w in (i, j))
        at = a[chosen, None] + u * (b - a)[chosen, None] + v * (c - a)[chosen, None]
        points.append(at.reshape(-1, 3))
    return np.concatenate(points)


def prisms(outlines: Sequence[NDArray[np.float64]], height: float) -> list[Mesh]:
    """Return convex prisms from z = 0 to a height that fill outlines exactly; cut by GEOS.

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
    return _prisms_of(functools.reduce(shapely.symmetric_difference, polygons), 0.0, height)


def cut_extruded(mesh: Mesh) -> list[Mesh]:
    """Return the convex prisms that fill a closed prism of any outline, such as a wall with doors.

    Nothing where the mesh is not one: of its triangles each is in one of two parallel ends of the
    same outline, or at right angles to them.
    """
    import shapely

    a, b, c = (mesh.vertices[mesh.faces[:, n]] for n in range(3))
    crosses = np.cross(b - a, c - a)
    areas = np.linalg.norm(crosses, axis=1) / 2.0
    normals = crosses / np.maximum(2.0 * areas, 1e-300)[:, None]
    left = np.ones(len(areas), np.bool_)
    for _ in range(MOST_AXES):  # the largest sides that are not parallel to one before
        if not left.any():
            break
        axes = axes_of(normals[int(np.argmax(np.where(left, areas, -1.0)))])
        along = np.abs(normals @ axes[:, 2])
        left &= along < 1.0 - TILT
        ends, placed = along > 1.0 - TILT, mesh.vertices @ axes
        z = placed[:, 2]
        low, high = float(z.min()), float(z.max())
        off = np.minimum(z - low, high - z).max() / max(float(np.ptp(placed, axis=0).max()), 1e-300)
        if off > EXACT or (along[~ends] > TILT).any():
            continue
        corners = placed[mesh.faces[ends]]
        upper = corners[:, :, 2].mean(axis=1) > (low + high) / 2.0
        one, other = (
            shapely.union_all(shapely.polygons(corners[chosen, :, :2]))
            for chosen in (upper, ~upper)
        )
        walls, rim = float(areas[~ends].sum()), one.length * (high - low)
        if one.symmetric_difference(other).area < TILT * one.area and abs(walls - rim) < TILT * rim:
            pieces = _prisms_of(one, low, high)
            return [Mesh(piece.vertices @ axes.T, piece.faces) for piece in pieces]
    return []


def _prisms_of(outline: shapely.Geometry, low: float, high: float) -> list[Mesh]:
    """Return prisms between two heights over the triangles of an outline in the plane."""
    import shapely

    triangles = shapely.constrained_delaunay_triangles(outline).geoms
    corners = [np.array(triangle.exterior.coords)[:3] for triangle in triangles]
    ends = [[np.column_stack([own, np.full(3, z)]) for z in (low, high)] for own in corners]
    return [found for pair in ends if (found := hull(np.concatenate(pair))) is not None]


def _areas(mesh: Mesh) -> NDArray[np.float64]:
    a, b, c = (mesh.vertices[mesh.faces[:, n]] for n in range(3))
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0)
