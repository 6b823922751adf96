"""Triangles of the geoms of a MuJoCo model, for viewers that draw no shapes of their own."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Kinds = mujoco.mjtGeom

SIDES, RINGS = 24, 8
"""Sides of a round shape, and rings from pole to pole."""

NOTHING = 1e-12
"""Area below which a triangle has none, m^2: of two at a pole one has none."""


def triangles_of(model: mujoco.MjModel, geom: int) -> Array:
    """Return the surface of a geom as triangles in its own frame, anticlockwise from outside.

    Args:
        model: The model.
        geom: Id of a geom.

    Returns:
        (n, 3, 3) m: corner by corner; none of a plane, which has no end.
    """
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind == Kinds.mjGEOM_MESH:
        return _mesh(model, int(model.geom_dataid[geom]))
    if kind == Kinds.mjGEOM_HFIELD:
        return _heights(model, int(model.geom_dataid[geom]))
    shape = _SHAPES.get(kind)
    return np.empty((0, 3, 3)) if shape is None else shape(size)


def _box(size: Array) -> Array:
    square = np.array([[-1.0, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]])
    top = _faces(square, np.array([[0, 1, 2], [0, 2, 3]]))
    sides = [top, top[..., [1, 2, 0]], top[..., [2, 0, 1]]]
    found = np.concatenate([*sides, *(-side[:, ::-1] for side in sides)])
    return np.asarray(found * size[:3])


def _cylinder(size: Array) -> Array:
    radius, half = float(size[0]), float(size[1])
    return _turned(np.array([[0.0, -half], [radius, -half], [radius, half], [0.0, half]]))


def _capsule(size: Array) -> Array:
    radius, half = float(size[0]), float(size[1])
    up = np.array([0.0, half])
    below, above = radius * _quarter(-1) - up, radius * _quarter(1) + up
    return _turned(np.concatenate([below, above]))


def _ellipsoid(size: Array) -> Array:
    return np.asarray(_sphere(np.ones(1)) * size[:3])


def _sphere(size: Array) -> Array:
    outline = np.concatenate([_quarter(-1), _quarter(1)[1:]])
    return float(size[0]) * _turned(outline)


def _quarter(side: int) -> Array:
    """Return a quarter of a unit circle (n, 2): distance from the axis and height, upwards.

    Args:
        side: -1 for the lower one, from the pole to the equator, 1 for the upper one.
    """
    angles = np.linspace(0.0, 0.5 * np.pi, RINGS // 2 + 1)
    angles = angles if side > 0 else -angles[::-1]
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _turned(outline: Array) -> Array:
    """Return the surface that an outline (n, 2), from below upwards, makes about the z axis."""
    angles = np.linspace(0.0, 2.0 * np.pi, SIDES, endpoint=False)
    around = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = np.concatenate(
        [np.column_stack([away * around, np.full(SIDES, height)]) for away, height in outline]
    )
    here = np.arange(SIDES)
    after = np.roll(here, -1)
    faces = []
    for ring in range(len(outline) - 1):
        low, high = SIDES * ring, SIDES * (ring + 1)
        faces += [np.stack([low + here, low + after, high + after], axis=1)]
        faces += [np.stack([low + here, high + after, high + here], axis=1)]
    found = _faces(points, np.concatenate(faces))
    area = np.linalg.norm(np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0]), axis=1)
    return np.asarray(found[area > NOTHING])


def _mesh(model: mujoco.MjModel, mesh: int) -> Array:
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    begin, number = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    return _faces(
        model.mesh_vert[first : first + count].astype(np.float64),
        model.mesh_face[begin : begin + number],
    )


def _heights(model: mujoco.MjModel, field: int) -> Array:
    """Return the upper surface of a height field, without its base."""
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    half_x, half_y, top, _ = model.hfield_size[field].tolist()
    begin = int(model.hfield_adr[field])
    heights = top * model.hfield_data[begin : begin + rows * columns].astype(np.float64)
    x, y = np.linspace(-half_x, half_x, columns), np.linspace(-half_y, half_y, rows)
    points = np.column_stack([np.tile(x, rows), np.repeat(y, columns), heights])
    corner = (columns * np.arange(rows - 1)[:, None] + np.arange(columns - 1)).ravel()
    right, beyond = corner + 1, corner + columns
    faces = [[corner, right, beyond + 1], [corner, beyond + 1, beyond]]
    return _faces(points, np.concatenate([np.stack(face, axis=1) for face in faces]))


def _faces(points: Array, corners: NDArray[np.integer]) -> Array:
    return np.asarray(points[corners], np.float64)


_SHAPES: dict[int, Callable[[Array], Array]] = {
    int(Kinds.mjGEOM_BOX): _box,
    int(Kinds.mjGEOM_CYLINDER): _cylinder,
    int(Kinds.mjGEOM_CAPSULE): _capsule,
    int(Kinds.mjGEOM_ELLIPSOID): _ellipsoid,
    int(Kinds.mjGEOM_SPHERE): _sphere,
}
