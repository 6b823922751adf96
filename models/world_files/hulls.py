"""Convex hulls of meshes, and distances between surfaces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_files.parts import Mesh
from wayproof.models.worlds.solids.triangles import distance_to_triangles

MAX_SAMPLES = 20_000
"""Number of points on a mesh at which the error is measured, about."""

PIECE_SAMPLES = 500
"""Number of points on a piece at which it is measured, about."""

MAX_EXACT_FACES = 1500
"""Triangles of a mesh up to which distances to all of them are measured."""

NEAREST = 8
"""Number of points on a mesh whose triangles a piece's vertex is measured against."""


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


def is_convex(piece: Mesh) -> bool:
    """Return whether the triangles cover the convex hull, but for a share of the size.

    No vertex lies beyond a triangle's plane on both of its sides, and the areas are the same: a
    surface that is open or folds back is not convex.
    """
    around = hull(piece.vertices)
    if around is None:
        return False
    size = float(np.ptp(piece.vertices, axis=0).max())
    a, b, c = (piece.vertices[piece.faces[:, n]] for n in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    kept = lengths > 1e-12 * size * size
    normals, a = normals[kept] / lengths[kept, None], a[kept]
    for normal, point in zip(normals, a, strict=True):
        heights = around.vertices @ normal - normal @ point
        if min(float(heights.max()), -float(heights.min())) > 1e-6 * size:
            return False
    return bool(_area(piece) >= (1.0 - 1e-3) * _area(around))


def _area(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, n]] for n in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2.0)


def surface_error(mesh: Mesh, pieces: list[Mesh]) -> float:
    """Return the greatest distance between a mesh's surface and that of its pieces' union, m.

    Measured at points spread over the mesh: how far outside of every piece they lie; and at points
    on pieces that lie in no other piece: how far from the mesh they are.
    """
    from scipy.spatial import cKDTree

    on_mesh, triangle = _samples(mesh)
    planes = [_planes(piece) for piece in pieces]
    missing = float(np.maximum(_distance_outside(on_mesh, planes), 0.0).max())
    tree = cKDTree(on_mesh)
    size = float(np.ptp(mesh.vertices, axis=0).max())
    extra = 0.0
    for n, piece in enumerate(pieces):
        points = _samples(piece, PIECE_SAMPLES)[0]
        others = planes[:n] + planes[n + 1 :]
        if others:
            points = points[_distance_outside(points, others) > 1e-3 * size]
        if not len(points):
            continue
        if len(mesh.faces) <= MAX_EXACT_FACES:
            gaps = distance_to_triangles(points, mesh.vertices[mesh.faces])
        else:
            near = tree.query(points, k=min(NEAREST, len(on_mesh)))[1]
            gaps = _to_triangles(points, mesh, triangle[near.reshape(len(points), -1)])
        extra = max(extra, float(gaps.max()))
    return max(missing, extra)


def _to_triangles(
    points: NDArray[np.float64], mesh: Mesh, near: NDArray[np.int64]
) -> NDArray[np.float64]:  # (n,)
    """Return the distance of each point (n, 3) to the nearest of its triangles (n, k), m."""
    from trimesh.triangles import closest_point

    triangles = mesh.vertices[mesh.faces[near.ravel()]]
    repeated = np.repeat(points, near.shape[1], axis=0)
    nearest = closest_point(triangles, repeated)  # type: ignore[no-untyped-call]  # of trimesh
    gaps = np.linalg.norm(nearest - repeated, axis=1)
    return np.asarray(np.nan_to_num(gaps, nan=np.inf).reshape(near.shape).min(axis=1))


def _samples(
    mesh: Mesh, number: int = MAX_SAMPLES
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return points (n, 3) spread over the triangles by their areas, and the triangle of each."""
    a, b, c = (mesh.vertices[mesh.faces[:, n]] for n in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0
    share = areas / max(float(areas.sum()), 1e-300)
    counts = np.ceil(np.sqrt(2.0 * share * number)).astype(int).clip(1)
    points, triangles = [], []
    for count in np.unique(counts):
        chosen = np.flatnonzero(counts == count)
        i, j = np.indices((count + 1, count + 1)).reshape(2, -1)
        u, v = (w[i + j <= count] / count for w in (i, j))
        at = a[chosen][:, None] + u[:, None] * (b - a)[chosen][:, None]
        points.append((at + v[:, None] * (c - a)[chosen][:, None]).reshape(-1, 3))
        triangles.append(np.repeat(chosen, len(u)))
    return np.concatenate(points), np.concatenate(triangles)


def _planes(piece: Mesh) -> NDArray[np.float64]:  # (m, 4)
    """Return the outward unit normal and offset of each face of a convex piece."""
    from scipy.spatial import ConvexHull

    return np.unique(np.asarray(ConvexHull(piece.vertices).equations), axis=0)


def _distance_outside(
    points: NDArray[np.float64], planes: list[NDArray[np.float64]]
) -> NDArray[np.float64]:  # (n,)
    """Return how far points lie outside of the nearest piece, at least, m; below 0 inside."""
    least = np.full(len(points), np.inf)
    for piece in planes:
        beyond = np.full(len(points), -np.inf)
        for plane in piece:
            np.maximum(beyond, points @ plane[:3] + plane[3], out=beyond)
        np.minimum(least, beyond, out=least)
    return least
