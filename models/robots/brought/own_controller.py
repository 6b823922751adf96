"""A robot with a controller of the user's own: its MJCF keeps its names, joints and actuators."""

from __future__ import annotations

import importlib
from typing import Any

import mujoco
import numpy as np

from models.devices import Rangefinder
from models.robots.brought.source import Source, Unusable, free
from models.robots.brought.spec_file import PLUGIN, SpecFile
from models.robots.brought.writing import farthest, mesh_points
from models.robots.robot import Controller
from models.sensors import ROBOT_GROUP


def kept_mjcf(source: Source, spec: SpecFile) -> str:
    """The robot alone, without what is only for show and without files.

    Raises:
        Unusable: It has something that cannot be kept.
    """
    if spec.motion is None:
        raise Unusable("motion: got none, expected ground or air with a controller of your own")
    if spec.motion == "ground" and spec.stance is None:
        raise Unusable("stance: got none, expected the base's height in standing, m")
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
        if isinstance(mount.device, Rangefinder):
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
        raise Unusable(f"mjcf without what is for show: {' '.join(str(error).split())}") from None
    if " file=" in text:
        raise Unusable("mjcf: a file that cannot be left out, expected shapes and meshes only")
    return text


def load_controller(name: str, model: mujoco.MjModel, prefix: str) -> Controller:
    """Make the controller `module:Class` of a compiled model.

    Raises:
        Unusable: It cannot be loaded, or lacks a method of `Controller`.
    """
    module, _, attribute = name.partition(PLUGIN)
    try:
        made: Any = getattr(importlib.import_module(module), attribute)(model, prefix)
    except (ImportError, AttributeError, TypeError, ValueError) as error:
        line = " ".join(str(error).split())
        raise Unusable(f"controller: got '{name}', which cannot be loaded: {line}") from None
    for method in ("reset", "follow", "state", "restore"):
        if not callable(getattr(made, method, None)):
            raise Unusable(f"controller: '{name}' has no {method}(), expected a Controller")
    controller: Controller = made
    return controller


def _keep_only(tree: Any, source: Source) -> None:
    """Leave out what is not the robot: floors, lights, other bodies, keyframes."""
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
