"""Surface normals where rays hit."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Array
from wayproof.models.rays.records import Soup
from wayproof.models.rays.soup import SHAPES, face_normals


def surface_normals(
    data: mujoco.MjData,
    soup: Soup | None,
    geom_id: NDArray[np.int32],
    face: NDArray[np.int32],
    points: Array,
) -> Array:
    """Return unit normals in the world at points on geoms, as `mujoco.mj_ray` reports them.

    A normal points out of the solid, and of a mesh to where its faces are wound about, whichever
    side the ray came from: from inside it does not face the ray.

    Args:
        data: Geom poses at which the rays were cast, and the model.
        soup: Triangles of the meshes and height fields, None without any.
        geom_id: (n,) geom that was met, -1 for a miss.
        face: (n,) triangle of a mesh or a height field, a row of `Soup.corners`.
        points: (n, 3) in the world, m; any where nothing was met.

    Returns:
        (n, 3), zeros for a miss.
    """
    model = data.model
    normals = np.zeros((len(geom_id), 3))
    kinds = np.where(geom_id >= 0, model.geom_type[geom_id], -1)
    for kind in np.unique(kinds[geom_id >= 0]):
        rows = np.flatnonzero(kinds == kind)
        ids = geom_id[rows]
        R = data.geom_xmat[ids].reshape(-1, 3, 3)
        if soup is not None and kind in SHAPES:
            local = face_normals(soup, face[rows])
        else:
            p = np.einsum("nji,nj->ni", R, points[rows] - data.geom_xpos[ids])
            local = OUTWARD[int(kind)](p, model.geom_size[ids])
        local = local / np.linalg.norm(local, axis=1, keepdims=True)
        normals[rows] = np.einsum("nij,nj->ni", R, local)
    return normals


def _plane(p: Array, size: Array) -> Array:
    return np.broadcast_to((0.0, 0.0, 1.0), p.shape)


def _sphere(p: Array, size: Array) -> Array:
    return p


def _capsule(p: Array, size: Array) -> Array:
    half = size[:, 1]
    return p - np.clip(p[:, 2], -half, half)[:, None] * (0.0, 0.0, 1.0)


def _ellipsoid(p: Array, size: Array) -> Array:
    return p / size**2


def _cylinder(p: Array, size: Array) -> Array:
    """Return normals of the side or the disc, whichever the point is least inside of."""
    across = np.hypot(p[:, 0], p[:, 1]) - size[:, 0]
    along = np.abs(p[:, 2]) - size[:, 1]
    end = np.sign(p[:, 2])[:, None] * (0.0, 0.0, 1.0)
    return np.where((along > across)[:, None], end, p * (1.0, 1.0, 0.0))


def _box(p: Array, size: Array) -> Array:
    axis = np.argmax(np.abs(p) - size, axis=1)
    local = np.zeros_like(p)
    every = np.arange(len(p))
    local[every, axis] = np.sign(p[every, axis])
    return local


OUTWARD: dict[int, Callable[[Array, Array], Array]] = {
    int(mujoco.mjtGeom.mjGEOM_PLANE): _plane,
    int(mujoco.mjtGeom.mjGEOM_SPHERE): _sphere,
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): _capsule,
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): _ellipsoid,
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): _cylinder,
    int(mujoco.mjtGeom.mjGEOM_BOX): _box,
}
"""Outward vectors by MuJoCo's `mjtGeom`, of any length, at points p (n, 3) in the geom's frame."""
