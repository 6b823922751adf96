"""The user's MJCF: found, checked to stay in its folder, compiled and posed at rest."""

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
