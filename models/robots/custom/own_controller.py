"""Robots with the user's own controller; the MJCF keeps its names, joints and actuators."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.robots.custom.source import RobotSpecError, Source, free, mesh_points
from wayproof.models.robots.custom.spec_file import SpecFile
from wayproof.models.robots.custom.writing import farthest
from wayproof.models.robots.robot import Controller, Setpoint
from wayproof.models.sensors.caster import ROBOT_GROUP
from wayproof.plugin import UserCodeError, load_class, user_code


def kept_mjcf(source: Source, spec: SpecFile) -> str:
    """Write the robot alone, without decoration and without files.

    Raises:
        RobotSpecError: It has something that cannot be kept.
    """
    if spec.motion is None:
        raise RobotSpecError(
            "motion: got none, expected ground or air with a controller of your own"
        )
    if spec.motion == "ground" and spec.stance is None:
        raise RobotSpecError("stance: got none, expected the base's height in standing, m")
    tree = free(mujoco.MjSpec.from_file(str(source.path)), spec.base)
    tree.compile()
    root = source.model.body_rootid
    bodies = [(body, body.id) for body in tree.bodies if root[body.id] == source.base]
    owner = source.model.geom_bodyid  # ids move once anything is deleted: they are read before
    geoms = [(geom, geom.id) for geom in tree.geoms if root[owner[geom.id]] == source.base]
    _state_masses(bodies, source)
    _keep_what_collides(tree, geoms, source)
    _keep_only(tree, source)
    base = tree.body(spec.base)
    for sensor, mount in zip(spec.sensors, spec.mounts(), strict=True):
        if mount.device.by_mujoco:
            base.add_site(name=sensor.name, pos=sensor.position, quat=[0.0, 1.0, 0.0, 0.0])
            tree.add_sensor(
                name=sensor.name, type=mujoco.mjtSensor.mjSENS_RANGEFINDER,
                objtype=mujoco.mjtObj.mjOBJ_SITE, objname=sensor.name,
            )  # fmt: skip
        else:
            base.add_site(name=sensor.name, pos=sensor.position)
    base.name = "base"
    try:
        tree.compile()
        text = str(tree.to_xml())
    except ValueError as error:
        raise RobotSpecError(
            f"mjcf without what is for show: {' '.join(str(error).split())}"
        ) from None
    if " file=" in text:
        raise RobotSpecError(
            "mjcf: a file that cannot be left out, expected shapes and meshes only"
        )
    return text


def load_controller(name: str, model: mujoco.MjModel, prefix: str) -> Controller:
    """Make the controller `module:Class` or `path/to/file.py:Class` of a compiled model.

    Raises:
        RobotSpecError: It cannot be loaded or made, or lacks a method of `Controller`.
    """
    who = f"controller '{name}'"
    try:
        kind = load_class(name)
        with user_code(who):
            made: Any = kind(model, prefix)
    except UserCodeError as error:
        raise RobotSpecError(str(error)) from error
    except ValueError as error:
        raise RobotSpecError(f"controller: got '{name}', which cannot be loaded: {error}") from None
    for method in ("reset", "follow", "state", "restore"):
        if not callable(getattr(made, method, None)):
            raise RobotSpecError(f"{who} has no {method}(), expected a Controller")
    return OwnController(who, made)


class OwnController:
    """A controller of the user's own; any exception of it becomes a `UserCodeError`."""

    def __init__(self, who: str, made: Controller) -> None:
        """Wrap a controller, with its name in errors."""
        self._who = who
        self._made = made

    def reset(self, data: mujoco.MjData, position: NDArray[np.float64], heading: float) -> None:
        """Place the robot; see `Controller`."""
        with user_code(self._who):
            self._made.reset(data, position, heading)

    def follow(self, data: mujoco.MjData, setpoint: Setpoint) -> None:
        """Write one step's actuator commands; see `Controller`.

        Raises:
            UserCodeError: It raised, or wrote what is not finite.
        """
        with user_code(self._who):
            self._made.follow(data, setpoint)
        for name in ("ctrl", "qfrc_applied", "xfrc_applied"):
            if not np.isfinite(getattr(data, name)).all():
                raise UserCodeError(self._who, f"wrote {name} that is not finite")

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the state between steps; see `Controller`."""
        with user_code(self._who):
            state = {name: np.array(value) for name, value in self._made.state().items()}
        for name, array in state.items():
            if array.dtype.kind not in "fiub":
                raise UserCodeError(self._who, f"has a state '{name}' of {array.dtype}")
        return state

    def restore(self, state: dict[str, NDArray[Any]]) -> None:
        """Continue from what `state` returned; see `Controller`."""
        with user_code(self._who):
            self._made.restore(state)


def _keep_only(tree: Any, source: Source) -> None:
    """Remove all but the robot: floors, lights, other bodies, keyframes."""
    name = source.model.body(source.base).name
    world = tree.worldbody
    others = [body for body in world.bodies if body.name != name]
    for element in [*others, *world.geoms, *world.sites, *world.lights, *world.cameras, *tree.keys]:
        tree.delete(element)


def _state_masses(bodies: list[tuple[Any, int]], source: Source) -> None:
    """Write masses down, so that leaving geoms out does not change them."""
    model, blank = source.model, mujoco.MjSpec().worldbody
    for body, index in bodies:
        if model.body_mass[index] > 0.0:
            body.explicitinertial = True
            body.mass = model.body_mass[index]
            body.ipos, body.iquat = model.body_ipos[index], model.body_iquat[index]
            body.inertia = model.body_inertia[index]
            body.ialt = blank.add_body().ialt
            body.fullinertia = np.full(6, np.nan)


def _keep_what_collides(tree: Any, geoms: list[tuple[Any, int]], source: Source) -> None:
    model, used, blank = source.model, set(), mujoco.MjSpec().worldbody
    for geom, index in geoms:
        if not model.geom_contype[index] | model.geom_conaffinity[index]:
            tree.delete(geom)
            continue
        geom.group, geom.contype, geom.conaffinity, geom.material = ROBOT_GROUP, 0, 1, ""
        if model.geom_type[index] == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = tree.add_mesh(name=f"hull_{index}")
            R = np.empty(9)
            mujoco.mju_quat2Mat(R, model.geom_quat[index])
            points = farthest(mesh_points(model, index)) @ R.reshape(3, 3).T
            mesh.uservert = (points + model.geom_pos[index]).ravel()
            geom.meshname = mesh.name
            geom.pos, geom.quat = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
            geom.alt = blank.add_geom().alt  # an angle there would be taken for the quaternion
            used.add(mesh.name)
    for mesh in list(tree.meshes):
        if mesh.name not in used:
            tree.delete(mesh)
    for element in [*tree.skins, *tree.materials, *tree.textures]:
        tree.delete(element)
