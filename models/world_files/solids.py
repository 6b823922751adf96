"""Solids of parts, for distance queries."""

from __future__ import annotations

from dataclasses import replace
from math import asin, atan2

import numpy as np
from numpy.typing import NDArray

from wayproof.models.world_files.hulls import hull
from wayproof.models.world_files.parts import Mesh, Part, vector
from wayproof.models.worlds.solids import (
    Box,
    Capsule,
    ConvexMesh,
    Cylinder,
    HeightField,
    Solid,
    Sphere,
    TriangleMesh,
)

RINGS, SECTORS = 12, 24
"""Numbers of rings and sectors of the triangles in place of an ellipsoid."""


def solid_of(part: Part) -> Solid:
    """Return the part as a solid in the world, as bodies meet it: a mesh as its convex hull.

    An ellipsoid is given by points on it.
    """
    if part.shape == "box":
        yaw, pitch, roll = _angles(part.R_world_part)
        return Box(part.position, vector(part.size), yaw, part.kind, pitch, roll)
    if part.shape in ("cylinder", "capsule"):
        radius, half = part.size
        along = half * part.R_world_part[:, 2]
        tail, head = vector(part.position - along), vector(part.position + along)
        kind = Cylinder if part.shape == "cylinder" else Capsule
        return kind(tail, head, radius, part.kind)
    if part.shape == "sphere":
        return Sphere(part.position, part.size[0], part.kind)
    if part.shape == "heights":
        return _ground(part)
    mesh = part.mesh or _globe(np.array(part.size))
    placed = part.position + mesh.vertices @ part.R_world_part.T
    return ConvexMesh.from_arrays(placed, mesh.faces, part.kind)


def _angles(R: NDArray[np.float64]) -> tuple[float, float, float]:
    """Yaw, pitch and roll of R = Rz(yaw) Ry(pitch) Rx(roll), rad."""
    if abs(R[2, 0]) > 1.0 - 1e-12:  # straight up or down: yaw takes all
        return atan2(-R[0, 1], R[1, 1]), -asin(float(np.sign(R[2, 0]))), 0.0
    return atan2(R[1, 0], R[0, 0]), -asin(R[2, 0]), atan2(R[2, 1], R[2, 2])


def _ground(part: Part) -> Solid:
    """Return a height field where it stands upright, its triangles where it is turned."""
    assert part.heights is not None
    half_x, half_y, rise, base = part.size
    ny, nx = part.heights.shape
    spacing = 2.0 * half_x / (nx - 1), 2.0 * half_y / (ny - 1)
    heights, kind = part.heights.T * rise, part.kind
    x, y, z = part.position
    if np.array_equal(part.R_world_part, np.eye(3)):
        corner = (x - half_x, y - half_y, z)
        return replace(HeightField.from_array(corner, spacing, heights, kind), base=base)
    own = HeightField.from_array((-half_x, -half_y, 0.0), spacing, heights, kind)
    corners = own.triangles.reshape(-1, 3) @ part.R_world_part.T + part.position
    return TriangleMesh.from_arrays(corners, np.arange(len(corners)).reshape(-1, 3), kind)


def _globe(half_axes: NDArray[np.float64]) -> Mesh:
    polar = np.linspace(0.0, np.pi, RINGS + 1)[:, None]
    around = np.linspace(0.0, 2.0 * np.pi, SECTORS, endpoint=False)
    x, y = np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around)
    places = np.stack([x, y, np.broadcast_to(np.cos(polar), x.shape)], axis=-1).reshape(-1, 3)
    around_it = hull(np.unique(places.round(12), axis=0) * half_axes)
    assert around_it is not None
    return around_it
