"""Single geoms: distance along a ray, and whether a point is inside."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import NDArray

Geoms = mujoco.mjtGeom


def distance_to(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    geom: int,
    origin: NDArray[np.float64],
    direction: NDArray[np.float64],
) -> float:
    """Return the distance to a geom along a ray, m; -1 for a miss, and for any SDF.

    Args:
        model: Holds the geom, whatever its group and colour.
        data: Geom poses.
        geom: Id.
        origin: (3,) world frame, m.
        direction: (3,) unit vector, world frame.
    """
    kind = model.geom_type[geom]
    if kind == Geoms.mjGEOM_MESH:
        return float(mujoco.mj_rayMesh(model, data, geom, origin, direction))
    if kind == Geoms.mjGEOM_HFIELD:
        return float(mujoco.mj_rayHfield(model, data, geom, origin, direction))
    if kind == Geoms.mjGEOM_SDF:
        return -1.0
    pose = data.geom_xpos[geom], data.geom_xmat[geom]
    return float(mujoco.mju_rayGeom(*pose, model.geom_size[geom], origin, direction, kind))


def holds(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, point: NDArray[np.float64]
) -> bool:
    """Return whether a point (3,) in the world is inside a geom; behind a plane counts as inside.

    Meshes are taken as closed surfaces; of a signed distance field nothing is said: False.
    """
    kind = int(model.geom_type[geom])
    if kind == Geoms.mjGEOM_MESH:
        return _holds_mesh(model, data, geom, point)
    R = data.geom_xmat[geom].reshape(3, 3)
    local = R.T @ (point - data.geom_xpos[geom])
    size = model.geom_size[geom]
    if kind == Geoms.mjGEOM_HFIELD:
        size = model.hfield_size[model.geom_dataid[geom]]  # x, y, top, base
        top = data.geom_xpos[geom] + R @ (local[0], local[1], size[2] + 1.0)
        surface = size[2] + 1.0 - distance_to(model, data, geom, top, -R[:, 2])
        return bool((np.abs(local[:2]) < size[:2]).all() and -size[3] < local[2] < surface)
    return kind in _HOLDS and bool(_HOLDS[kind](local, size))


Inside = Callable[[NDArray[np.float64], NDArray[np.float64]], bool]

_HOLDS: dict[int, Inside] = {
    int(Geoms.mjGEOM_PLANE): lambda p, s: bool(
        p[2] < 0.0 and (s[0] == 0.0 or abs(p[0]) < s[0]) and (s[1] == 0.0 or abs(p[1]) < s[1])
    ),
    int(Geoms.mjGEOM_SPHERE): lambda p, s: bool(np.linalg.norm(p) < s[0]),
    int(Geoms.mjGEOM_CAPSULE): lambda p, s: bool(
        np.linalg.norm([p[0], p[1], max(abs(p[2]) - s[1], 0.0)]) < s[0]
    ),
    int(Geoms.mjGEOM_ELLIPSOID): lambda p, s: bool(np.linalg.norm(p / s) < 1.0),
    int(Geoms.mjGEOM_CYLINDER): lambda p, s: bool(np.hypot(p[0], p[1]) < s[0] and abs(p[2]) < s[1]),
    int(Geoms.mjGEOM_BOX): lambda p, s: bool((np.abs(p) < s).all()),
}
"""Tests by shape whether a point (3,) in the geom's frame is inside, given the size (3,)."""

SKEW_DIRECTIONS = np.array([[0.48, 0.6, 0.64], [-0.64, 0.48, 0.6], [0.6, -0.64, -0.48]])
"""Directions along no axis, which rarely meet an edge."""


def _holds_mesh(
    model: mujoco.MjModel, data: mujoco.MjData, geom: int, point: NDArray[np.float64]
) -> bool:
    """Return whether a point is inside a mesh, by parity of crossings along most of three rays."""
    return sum(_crossings(model, data, geom, point, ray) % 2 for ray in SKEW_DIRECTIONS) >= 2


def _crossings(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    geom: int,
    point: NDArray[np.float64],
    ray: NDArray[np.float64],
) -> int:
    count, start = 0, point
    while (distance := distance_to(model, data, geom, start, ray)) >= 0.0:
        count += 1
        start = start + (distance + 1e-6) * ray  # go on just behind the surface, 1 um
    return count
