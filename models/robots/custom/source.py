"""The user's MJCF: found, checked to stay in its folder, compiled and posed at rest; its feet."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from wayproof.models.arrays import Array
from wayproof.models.world_files.mjcf_files import OUTSIDE, check_scene
from wayproof.models.world_files.mjcf_scenes import NOT_COMPILED
from wayproof.models.world_files.reading import WorldFileError


class RobotSpecError(ValueError):
    """A spec or an MJCF that no robot can be made of; the message is one line."""


class Source(NamedTuple):
    """A compiled MJCF in the pose that it is written in.

    Attributes:
        model: Compiled model.
        data: Kinematics of the pose without any joint displacement.
        base: Body id of the robot's base.
        path: Path of the MJCF.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    base: int
    path: Path

    def place(self, point: Array) -> Array:
        """Return a point (3,) of the world in the base's frame, m."""
        R = self.data.xmat[self.base].reshape(3, 3)
        return np.asarray(R.T @ (point - self.data.xpos[self.base]))

    def turn(self, matrix: Array) -> Array:
        """Return a rotation (3, 3) or direction (3,) of the world in the base's frame."""
        R = self.data.xmat[self.base].reshape(3, 3)
        return np.asarray(R.T @ matrix)

    def rigid(self, body: int) -> list[int]:
        """Return the bodies that are fixed to a moving body, itself among them."""
        return np.flatnonzero(self.model.body_weldid == body).tolist()

    def colliding(self, body: int) -> list[int]:
        """Return the geoms fixed to a moving body that contacts meet; others are decoration.

        A base that nothing would collide with meets contacts with all that is drawn of it: else a
        trunk that goes through a wall would be no collision.
        """
        model = self.model
        own = np.flatnonzero(model.body_weldid[model.geom_bodyid] == body).tolist()
        meet = [geom for geom in own if model.geom_contype[geom] | model.geom_conaffinity[geom]]
        return own if body == self.base and not meet else meet


def find_mjcf(named: str, folder: Path) -> Path:
    """Return the file that a spec names: beside it, or in an installed package.

    Raises:
        RobotSpecError: No such file or package.
    """
    package, separator, inner = named.partition(":")
    if separator and "/" not in package and len(package) > 1:
        found = importlib.util.find_spec(package) if package.isidentifier() else None
        if found is None or not found.submodule_search_locations:
            raise RobotSpecError(f"mjcf: got '{named}', but no package '{package}' is installed")
        path = Path(next(iter(found.submodule_search_locations))) / inner
    else:
        path = folder / named
    if not path.is_file():
        raise RobotSpecError(f"mjcf: no file '{path}'")
    return path


def open_source(path: Path, base: str, folder: Path) -> Source:
    """Compile an MJCF and look at its rest pose.

    Args:
        path: The MJCF.
        base: Name of the robot's base.
        folder: Folder of the spec file. What the MJCF names has to lie below it if the MJCF itself
            does, else in the MJCF's own folder.

    Raises:
        RobotSpecError: It reaches outside these, does not compile, or has no such base.
    """
    try:
        check_scene(path, folder if path.resolve().is_relative_to(folder.resolve()) else None)
        tree = mujoco.MjSpec.from_file(str(path))
        model = free(tree, base).compile()
    except WorldFileError as error:
        line = str(error).replace(OUTSIDE, "expected the spec file in a folder that holds both")
        raise RobotSpecError(f"mjcf: {line}") from None
    except NOT_COMPILED as error:
        raise RobotSpecError(f"mjcf '{path}': {' '.join(str(error).split())[:300]}") from None
    body = find(model, mujoco.mjtObj.mjOBJ_BODY, base)
    if body is None:
        bodies = [model.body(i).name for i in np.flatnonzero(model.body_parentid == 0)[1:]]
        raise RobotSpecError(
            f"base: no body '{base}' in '{path.name}' (available: {', '.join(bodies)})"
        )
    joint, parent = int(model.body_jntadr[body]), int(model.body_parentid[body])
    if parent or joint < 0 or model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_FREE:
        raise RobotSpecError(f"base: body '{base}' is not free, expected a child of the world")
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return Source(model, data, body, path)


def free(tree: mujoco.MjSpec, base: str) -> mujoco.MjSpec:
    """Give a base without any joint, which many models leave to the scene, a free one."""
    body = tree.body(base)
    if body is not None and not body.joints:
        body.add_freejoint()
    return tree


def find(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str) -> int | None:
    """Return the id of a named object of a kind; None if there is none."""
    found = mujoco.mj_name2id(model, kind, name)
    return None if found < 0 else int(found)


def mesh_points(model: mujoco.MjModel, geom: int) -> Array:  # (n, 3)
    """Return the vertices of a mesh geom in its own frame, m."""
    mesh = model.geom_dataid[geom]
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    return np.asarray(model.mesh_vert[first : first + count], np.float64)


Kinds = mujoco.mjtGeom

TIP = 0.05
"""Share of a mesh's reach from the joint that its end is fitted over."""

MAX_RADIUS = 0.25
"""Maximum radius of a sphere fitted to a mesh's end, as a share of the reach."""


class FootSphere(NamedTuple):
    """A sphere at the end of a leg.

    Attributes:
        geom: Id of the geom that it is, or is the end of.
        place: (3,) centre in the world, m.
        radius: m.
        whole: Whether the geom is this sphere and nothing more.
    """

    geom: int
    place: Array
    radius: float
    whole: bool


def foot_sphere(source: Source, link: int) -> FootSphere | None:
    """Return the foot of a moving body that hangs on one joint.

    The lowest sphere that collides, or lowest end of a capsule; of a body with neither, the sphere
    fitted to the end of its colliding meshes that is farthest from its joint.

    Returns:
        None if the body has none of these.
    """
    model, data = source.model, source.data
    found: list[tuple[float, int, FootSphere]] = []
    for geom in source.colliding(link):
        radius, half = model.geom_size[geom, :2].tolist()
        at, axis = data.geom_xpos[geom], data.geom_xmat[geom].reshape(3, 3)[:, 2]
        whole = bool(model.geom_type[geom] == Kinds.mjGEOM_SPHERE)
        if whole:
            ends = [at]
        elif model.geom_type[geom] == Kinds.mjGEOM_CAPSULE:
            ends = [at - half * axis, at + half * axis]
        else:
            continue
        found += [
            (float(end[2]) - radius, geom, FootSphere(geom, end.copy(), radius, whole))
            for end in ends
        ]
    return min(found, key=lambda one: one[:2])[2] if found else _mesh_end(source, link)


def _mesh_end(source: Source, link: int) -> FootSphere | None:
    """Fit a sphere to the end of a link's colliding meshes by least squares."""
    model, data = source.model, source.data
    joint = int(model.body_jntadr[link])
    meshes = [g for g in source.colliding(link) if model.geom_type[g] == Kinds.mjGEOM_MESH]
    if joint < 0 or not meshes:
        return None
    points = np.concatenate(
        [
            mesh_points(model, geom) @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
            for geom in meshes
        ]
    )
    arms = points - data.xanchor[joint]
    axis = data.xaxis[joint]
    across = arms - np.outer(arms @ axis, axis)
    distance = np.linalg.norm(across, axis=1)
    farthest, reach = int(distance.argmax()), float(distance.max())
    if not reach > 0.0:
        return None
    along = arms @ (across[farthest] / reach)
    tip = points[along >= (1.0 - TIP) * reach]
    middle = tip.mean(axis=0)
    # |p - c|^2 = r^2 is linear in c and r^2 - |c|^2 (Coope 1993)
    offsets = tip - middle
    unknowns = np.column_stack([2.0 * offsets, np.ones(len(offsets))])
    solved, _, rank, _ = np.linalg.lstsq(unknowns, (offsets**2).sum(axis=1), rcond=None)
    square = float(solved[3] + solved[:3] @ solved[:3])
    if rank < 4 or not 0.0 < square < (MAX_RADIUS * reach) ** 2:
        return None
    geom = next(
        g for g, n in zip(meshes, np.cumsum([len(mesh_points(model, g)) for g in meshes]),
                          strict=True) if farthest < n
    )  # fmt: skip
    return FootSphere(geom, middle + solved[:3], float(np.sqrt(square)), whole=False)
