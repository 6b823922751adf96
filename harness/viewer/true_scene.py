"""True geometry of a log as triangles: the static one, and each mover in its own frame."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log
from wayproof.harness.scenario.mujoco_warnings import redirect_mujoco_warnings
from wayproof.harness.scenario.scene_text import safe_scene
from wayproof.harness.viewer.colours import GLASS, GROUND, OBSTACLES
from wayproof.models.classes import CLASSES
from wayproof.models.sensors.caster import ROBOT_GROUP
from wayproof.models.world_files.mjcf_scenes import NOT_COMPILED

Array = NDArray[np.float64]

FLOOR = CLASSES.index("floor")

SIDES, RINGS = 24, 8
"""Points of a circle, and rings of a ball from pole to pole."""


@dataclass(frozen=True)
class TrueScene:
    """Surfaces of a scene without the robot, (n, 3, 3) m: the corners of triangles.

    Attributes:
        still: Parts that stand still, in the world's frame; one without triangles is left out.
        movers: Each mover in its own frame, by its name in the truth.
    """

    still: dict[str, Array]
    movers: dict[str, Array]


def true_scene(log: Log) -> TrueScene | None:
    """Return the true geometry of the scene in a log; None of a recording, which has none.

    Raises:
        InputError: The scene in the log cannot be compiled.
    """
    if log.config.recording is not None:
        return None
    redirect_mujoco_warnings()
    try:
        model = mujoco.MjModel.from_xml_string(safe_scene(log.scene))
    except NOT_COMPILED as error:
        line = " ".join(str(error).split())[:200]
        raise InputError(f"log '{log.path}': its scene: {line}") from None
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    still: dict[str, list[Array]] = {OBSTACLES: [], GLASS: [], GROUND: []}
    movers: dict[str, list[Array]] = {}
    for geom in np.flatnonzero(model.geom_group != ROBOT_GROUP).tolist():
        body = int(model.geom_bodyid[geom])
        triangles = triangles_of(model, geom)
        if model.body_mocapid[body] >= 0:
            turn = np.zeros(9)
            mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
            placed = _placed(triangles, turn, model.geom_pos[geom])
            movers.setdefault(str(model.body(body).name), []).append(placed)
        else:
            placed = _placed(triangles, data.geom_xmat[geom], data.geom_xpos[geom])
            still[_part(model, geom)].append(placed)
    joined = {part: np.concatenate(pieces) for part, pieces in still.items() if pieces}
    return TrueScene(
        {part: triangles for part, triangles in joined.items() if len(triangles)},
        {name: np.concatenate(pieces) for name, pieces in movers.items()},
    )


def _part(model: mujoco.MjModel, geom: int) -> str:
    if model.nuser_geom and model.geom_user[geom, 0] == FLOOR:
        return GROUND
    material = int(model.geom_matid[geom])
    alpha = model.geom_rgba[geom, 3] if material < 0 else model.mat_rgba[material, 3]
    return OBSTACLES if alpha > 0.0 else GLASS


def _placed(triangles: Array, rotation: Array, position: Array) -> Array:
    """Return triangles (n, 3, 3) turned by a rotation (9,) row by row, and moved by (3,), m."""
    R = rotation.reshape(3, 3)
    return np.asarray(np.einsum("ij,nkj->nki", R, triangles) + position)


def triangles_of(model: mujoco.MjModel, geom: int) -> Array:
    """Return the surface of a geom as triangles in its own frame, anticlockwise from outside.

    Returns:
        (n, 3, 3) m: corner by corner; none of a plane, which has no end.
    """
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    source = int(model.geom_dataid[geom])
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        first, begin = model.mesh_vertadr[source], model.mesh_faceadr[source]
        points = model.mesh_vert[first : first + model.mesh_vertnum[source]]
        corners = model.mesh_face[begin : begin + model.mesh_facenum[source]]
        return np.asarray(points[corners], np.float64)
    if kind == mujoco.mjtGeom.mjGEOM_HFIELD:
        return _heights(model, source)
    points = _convex(kind, size)
    return np.empty((0, 3, 3)) if points is None else _hull(points)


def _convex(kind: int, size: Array) -> Array | None:
    """Return points (n, 3), m, whose convex hull is a shape about the origin; None of no shape."""
    kinds, ball = mujoco.mjtGeom, _ball()
    up = np.array([0.0, 0.0, size[1]])
    if kind == kinds.mjGEOM_BOX:
        return np.asarray(size * (2.0 * np.argwhere(np.ones((2, 2, 2))) - 1.0))
    if kind == kinds.mjGEOM_SPHERE:
        return np.asarray(size[0] * ball)
    if kind == kinds.mjGEOM_ELLIPSOID:
        return np.asarray(size * ball)
    if kind == kinds.mjGEOM_CYLINDER:
        ring = size[0] * ball[np.abs(ball[:, 2]) < 1e-9]
        return np.concatenate([ring - up, ring + up])
    if kind == kinds.mjGEOM_CAPSULE:
        return np.concatenate([size[0] * ball - up, size[0] * ball + up])
    return None


def _ball() -> Array:
    """Return points (n, 3) of a ball of radius 1: rings from pole to pole."""
    around = 2.0 * np.pi * np.arange(SIDES) / SIDES
    polar = np.pi * np.arange(1, RINGS)[:, None] / RINGS
    x, y = np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around)
    rings = np.stack([x, y, np.cos(polar) + 0.0 * around], axis=-1).reshape(-1, 3)
    return np.concatenate([rings, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])


def _hull(points: Array) -> Array:
    """Return the triangles of the convex hull of points about the origin."""
    found: Array = points[ConvexHull(points).simplices]
    normals = np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0])
    inwards = np.einsum("ni,ni->n", normals, found[:, 0]) < 0.0
    found[inwards] = found[inwards][:, ::-1]
    return found


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
    return np.asarray(points[np.concatenate([np.stack(face, axis=1) for face in faces])])
