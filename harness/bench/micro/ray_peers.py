"""Peers of the ray casters: Open3D and Embree, on the triangles of a scene.

Both need the extra `bench`; one that is not installed is left out. They know triangles alone, in
single precision, so round shapes are tessellated and their error is for the most part that of the
tessellation.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError

Hits = tuple[NDArray[np.float64], NDArray[np.int32]]
Cast = Callable[[], Hits]
"""Casts the beams that it was made with: distances (n,) in m and geom ids (n,); -1 for a miss."""

FAR = 200.0
"""Half side of the square in place of an infinite plane, m."""

ROUND = 48
"""Sides of a tessellated circle: off by 0.2 % of its radius."""


def installed_peers() -> dict[str, Callable[..., Cast]]:
    """Return the makers of the installed peers by name.

    Raises:
        InputError: One is installed and cannot be imported, as without a library of the system.
    """
    peers = {}
    if find_spec("trimesh") and _imports("open3d"):
        peers["open3d"] = _open3d
    if find_spec("trimesh") and _imports("embreex"):
        peers["embree"] = _embree
    return peers


def _imports(name: str) -> bool:
    """Import a module if it is installed; return whether it is."""
    if find_spec(name) is None:
        return False
    try:
        import_module(name)
    except ImportError as error:
        raise InputError(
            f"{name}: installed, but cannot be imported ({error}); "
            "expected what it needs, or to be uninstalled"
        ) from error
    return True


def _open3d(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    origin: NDArray[np.float64],
    directions: NDArray[np.float64],
    range: float,
    threads: int,
) -> Cast:
    """Return a caster of Open3D's RaycastingScene, which wraps Embree."""
    import open3d

    vertices, faces, owners = triangles(model, data)
    scene = open3d.t.geometry.RaycastingScene(nthreads=threads)
    scene.add_triangles(
        open3d.core.Tensor(vertices.astype(np.float32)),
        open3d.core.Tensor(faces.astype(np.uint32)),
    )
    rays = np.hstack([np.broadcast_to(origin, directions.shape), directions])
    tensor = open3d.core.Tensor(rays.astype(np.float32))

    def cast() -> Hits:
        answer = scene.cast_rays(tensor, nthreads=threads)
        distance = answer["t_hit"].numpy().astype(np.float64)
        face = answer["primitive_ids"].numpy().astype(np.int64)
        return _hits(distance, face, owners, np.isfinite(distance) & (distance <= range))

    return cast


def _embree(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    origin: NDArray[np.float64],
    directions: NDArray[np.float64],
    range: float,
    threads: int,
) -> Cast:
    """Return a caster of Embree by embreex, ray by ray on one thread."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore import EmbreeDevice
    from embreex.rtcore_scene import EmbreeScene

    if threads != 1:
        raise ValueError(f"threads: got {threads}, expected 1, embreex casts on one")
    vertices, faces, owners = triangles(model, data)
    device = EmbreeDevice()
    scene = EmbreeScene(device)
    mesh = TriangleMesh(scene, vertices[faces].astype(np.float32))
    origins = np.ascontiguousarray(np.broadcast_to(origin, directions.shape), np.float32)
    rays = np.ascontiguousarray(directions, np.float32)

    def cast(_alive: Any = (device, mesh)) -> Hits:  # embreex keeps no reference to either
        answer = scene.run(origins, rays, output=True)
        distance = answer["tfar"].astype(np.float64)
        face = answer["primID"].astype(np.int64)
        return _hits(distance, face, owners, (face >= 0) & (distance <= range))

    return cast


def _hits(
    distance: NDArray[np.float64],
    face: NDArray[np.int64],
    owners: NDArray[np.int32],
    hit: NDArray[np.bool_],
) -> Hits:
    return np.where(hit, distance, -1.0), np.where(hit, owners[np.where(hit, face, 0)], -1)


def triangles(
    model: mujoco.MjModel, data: mujoco.MjData
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int32]]:
    """Return every geom as triangles in the world.

    Returns:
        Vertices (v, 3) in m, corners of faces (f, 3), and the geom id of each face (f,).

    Raises:
        ValueError: A geom has no tessellation here.
    """
    vertices, faces, owners, count = [], [], [], 0
    for geom in range(model.ngeom):
        points, corners = _tessellate(model, geom)
        R_world_geom = data.geom_xmat[geom].reshape(3, 3)
        vertices.append(points @ R_world_geom.T + data.geom_xpos[geom])
        faces.append(corners + count)
        owners.append(np.full(len(corners), geom, np.int32))
        count += len(points)
    return np.concatenate(vertices), np.concatenate(faces), np.concatenate(owners)


def _tessellate(model: mujoco.MjModel, geom: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return vertices (v, 3) in the geom's frame and corners (f, 3)."""
    from trimesh import creation

    kind = mujoco.mjtGeom(int(model.geom_type[geom]))
    size, asset = model.geom_size[geom], int(model.geom_dataid[geom])
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        first, count = model.mesh_vertadr[asset], model.mesh_vertnum[asset]
        face, number = model.mesh_faceadr[asset], model.mesh_facenum[asset]
        points = model.mesh_vert[first : first + count].astype(np.float64)
        return points, model.mesh_face[face : face + number].astype(np.int64)
    if kind == mujoco.mjtGeom.mjGEOM_HFIELD:
        return _field_triangles(model, asset)
    if kind == mujoco.mjtGeom.mjGEOM_PLANE:
        half = np.where(size[:2] > 0.0, size[:2], FAR)
        square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [*half, 0.0]
        return square, np.array([[0, 1, 2], [0, 2, 3]])
    makers: dict[mujoco.mjtGeom, Callable[[], Any]] = {
        mujoco.mjtGeom.mjGEOM_SPHERE: lambda: creation.icosphere(4, size[0]),
        mujoco.mjtGeom.mjGEOM_ELLIPSOID: lambda: creation.icosphere(4, 1.0).apply_scale(size),
        mujoco.mjtGeom.mjGEOM_BOX: lambda: creation.box(2.0 * size),
        mujoco.mjtGeom.mjGEOM_CYLINDER: lambda: creation.cylinder(
            size[0], 2.0 * size[1], sections=ROUND
        ),
        mujoco.mjtGeom.mjGEOM_CAPSULE: lambda: creation.capsule(
            2.0 * size[1], size[0], count=[ROUND, ROUND]
        ),
    }
    if kind not in makers:
        raise ValueError(f"geom {geom}: got shape {kind.name}, expected one with a tessellation")
    mesh = makers[kind]()
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def _field_triangles(
    model: mujoco.MjModel, asset: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the upper surface of a height field, each cell cut as MuJoCo cuts it."""
    rows, columns = int(model.hfield_nrow[asset]), int(model.hfield_ncol[asset])
    half_x, half_y, relief, _ = model.hfield_size[asset]
    first = model.hfield_adr[asset]
    heights = model.hfield_data[first : first + rows * columns].reshape(rows, columns)
    y, x = np.meshgrid(
        np.linspace(-half_y, half_y, rows), np.linspace(-half_x, half_x, columns), indexing="ij"
    )
    vertices = np.stack([x, y, relief * heights.astype(np.float64)], axis=-1).reshape(-1, 3)
    corner = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (
        side.ravel()
        for side in (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1])
    )
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return vertices, faces
