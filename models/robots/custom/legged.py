"""Quadrupeds of the usual layout, rewritten for the trot controller.

Each leg is a hip that turns about x, then thigh and calf about y, and a foot. The MJCF is written
again: links in the order of `LEGS`, joint axes along +x and +y, and zero angles where thigh and
calf hang straight down, which `ref` shifts to. The base's origin moves to the middle of the hips.
So links, axes, signs, names and order may be any; what the controller needs is read off the result.
"""

from __future__ import annotations

from math import atan2, hypot
from typing import NamedTuple

import mujoco
import numpy as np

from wayproof.models.arrays import Array
from wayproof.models.robots.custom.legged_parameters import legged_parameters
from wayproof.models.robots.custom.source import RobotSpecError, Source, find, foot_sphere
from wayproof.models.robots.custom.spec_file import SpecFile
from wayproof.models.robots.custom.writing import (
    HEAD,
    Assets,
    check_size,
    geoms,
    inertial,
    numbers,
    rangefinders,
    sensor_sites,
    surface,
)
from wayproof.models.robots.quadruped.parameters import JOINTS, LEGS, standing_joints
from wayproof.models.robots.quadruped.robot import FOOT_CONTACT, TOUCH_MARGIN

Objects = mujoco.mjtObj

MAX_AXIS_TILT = 0.01
"""Maximum angle of a joint axis off x or y, rad."""

MAX_ASYMMETRY = 0.01
"""Maximum difference of a leg from its mirror image, m."""


class Leg(NamedTuple):
    """A leg in the source, and its shape in the base's frame at rest.

    Attributes:
        links: Body ids of hip, thigh and calf.
        joints: Joint ids.
        signs: +1 or -1: whether each axis points along +x, +y, +y.
        torques: Largest torque of each joint, Nm.
        anchors: (3, 3) places of the joints, m.
        foot: (3,) centre of the foot, m.
        foot_radius: m.
        foot_geom: Geom id of the foot, -1 if it is a site.
    """

    links: list[int]
    joints: list[int]
    signs: list[float]
    torques: list[float]
    anchors: Array
    foot: Array
    foot_radius: float
    foot_geom: int

    @property
    def zeros(self) -> tuple[float, float, float]:
        """Angles from hanging straight down at rest, rad."""
        thigh, shank = self.anchors[2] - self.anchors[1], self.foot - self.anchors[2]
        first, second = atan2(-thigh[0], -thigh[2]), atan2(-shank[0], -shank[2])
        turn = (second - first + np.pi) % (2.0 * np.pi) - np.pi
        return 0.0, first, float(turn)


def legged_mjcf(source: Source, spec: SpecFile) -> str:
    """Write the robot alone, in the form of the trot controller.

    Raises:
        RobotSpecError: It has not the usual layout, or the spec does not fit it.
    """
    if spec.feet is None:
        raise RobotSpecError("feet: got none, expected four names for the controller 'trot'")
    legs = [_trace(source, name, foot) for name, foot in zip(LEGS, spec.feet, strict=True)]
    _check_joints(source, legs, spec)
    origin = np.mean([[leg.anchors[1][0], leg.anchors[0][1], leg.anchors[0][2]] for leg in legs], 0)
    _check_places(legs, origin)
    assets = Assets()
    limits = spec.joints.torque or tuple(np.min([leg.torques for leg in legs], axis=0))
    bodies = "".join(
        _leg(source, name, leg, origin, assets) for name, leg in zip(LEGS, legs, strict=True)
    )
    motors = "".join(
        f'<motor name="{leg}_{joint}" joint="{leg}_{joint}" ctrlrange="{numbers((-t, t))}"/>'
        for leg in LEGS
        for joint, t in zip(JOINTS, limits, strict=True)
    )
    touch = "".join(f'<touch name="{leg}_touch" site="{leg}_foot"/>' for leg in LEGS)
    trunk = inertial(source, source.rigid(source.base), origin)
    trunk += geoms(source, source.base, origin, assets) + sensor_sites(spec, origin)
    return f"""<mujoco model="{spec.name}">
  {HEAD}
  <asset>{assets.text}</asset>
  <worldbody>
    <body name="base"><freejoint name="root"/>{trunk}{bodies}</body>
  </worldbody>
  <actuator>{motors}</actuator>
  <sensor>{touch}{rangefinders(spec)}</sensor>
</mujoco>"""


def check_legged(spec: SpecFile, model: mujoco.MjModel) -> None:
    """Refuse a radius or height that the standing robot exceeds.

    Args:
        spec: The robot's.
        model: Compiled `legged_mjcf`, alone.
    """
    parameters = legged_parameters(model, "", spec)
    data = mujoco.MjData(model)
    data.qpos[:7] = 0.0, 0.0, parameters.gait.height, 1.0, 0.0, 0.0, 0.0
    data.qpos[7:] = 4 * standing_joints(parameters.geometry, parameters.gait.height)
    mujoco.mj_kinematics(model, data)
    check_size(spec, surface(model, data), flying=False)


def _trace(source: Source, leg: str, foot: str) -> Leg:
    """Trace a leg from its foot up to the base."""
    model, data = source.model, source.data
    geom = find(model, Objects.mjOBJ_GEOM, foot)
    site = find(model, Objects.mjOBJ_SITE, foot)
    link = find(model, Objects.mjOBJ_BODY, foot)
    if geom is not None and model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_SPHERE:
        body, place, radius = model.geom_bodyid[geom], data.geom_xpos[geom], model.geom_size[geom]
    elif site is not None:
        geom = -1
        body, place, radius = model.site_bodyid[site], data.site_xpos[site], model.site_size[site]
    elif link is not None and (sphere := foot_sphere(source, int(model.body_weldid[link]))):
        body, place, radius = link, sphere.place, np.array([sphere.radius])
        geom = sphere.geom if sphere.whole else -1  # else the geom stays, and its end is the foot
    else:
        kind = "neither a geom, a site nor a body" if geom is None else "no sphere"
        kind = kind if link is None else "a body without a sphere, capsule or mesh that collides"
        raise RobotSpecError(
            f"feet: '{foot}' is {kind}, expected a sphere geom, a site, or the body of one"
        )
    links: list[int] = []
    body = int(model.body_weldid[body])
    while body not in (source.base, 0):
        links.insert(0, body)
        body = int(model.body_weldid[model.body_parentid[body]])
    turning = [model.body_jntnum[link] == 1 for link in links]
    hinges = [model.jnt_type[model.body_jntadr[link]] for link in links]
    if body == 0 or len(links) != 3 or not all(turning) or set(hinges) != {3}:
        raise RobotSpecError(
            f"feet: '{foot}' hangs on {sum(model.body_jntnum[links])} joints of base "
            f"'{model.body(source.base).name}', expected three hinges: hip, thigh, calf"
        )
    joints = [int(model.body_jntadr[link]) for link in links]
    return Leg(
        links=links,
        joints=joints,
        signs=[_sign(source, joint, axis) for joint, axis in zip(joints, (0, 1, 1), strict=True)],
        torques=[_torque(model, joint) for joint in joints],
        anchors=np.array([source.place(data.xanchor[joint]) for joint in joints]),
        foot=source.place(place),
        foot_radius=float(radius[0]),
        foot_geom=int(geom),
    )


def _sign(source: Source, joint: int, along: int) -> float:
    axis = source.turn(source.data.xaxis[joint])
    if abs(axis[along]) < np.cos(MAX_AXIS_TILT):
        text = ", ".join(f"{value:.3f}" for value in axis)
        name = source.model.joint(joint).name
        raise RobotSpecError(
            f"joint '{name}': axis ({text}) in the base, expected along {'xy'[along]}"
        )
    return float(np.sign(axis[along]))


def _torque(model: mujoco.MjModel, joint: int) -> float:
    """Return the torque limit of a joint's actuator, of any kind; NaN without one."""
    kinds = (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT)
    name = model.joint(joint).name
    moving = np.isin(model.actuator_trntype, kinds) & (model.actuator_trnid[:, 0] == joint)
    found = np.flatnonzero(moving)
    if len(found) != 1:
        raise RobotSpecError(f"joint '{name}': {len(found)} actuators, expected one")
    actuator = int(found[0])
    gear = abs(float(model.actuator_gear[actuator, 0]))
    limits = []
    if model.actuator_forcelimited[actuator]:
        limits.append(gear * float(np.abs(model.actuator_forcerange[actuator]).min()))
    motor = model.actuator_biastype[actuator] == mujoco.mjtBias.mjBIAS_NONE
    if motor and model.actuator_ctrllimited[actuator]:
        gain = gear * abs(float(model.actuator_gainprm[actuator, 0]))
        limits.append(gain * float(np.abs(model.actuator_ctrlrange[actuator]).min()))
    if model.jnt_actfrclimited[joint]:
        limits.append(float(np.abs(model.jnt_actfrcrange[joint]).min()))
    return min(limits, default=float("nan"))


def _check_joints(source: Source, legs: list[Leg], spec: SpecFile) -> None:
    model = source.model
    own = {joint for leg in legs for joint in leg.joints}
    if len(own) != 12:
        raise RobotSpecError(
            f"feet: got {', '.join(spec.feet or ())}, expected four different legs"
        )
    for joint in range(model.njnt):
        root = model.body_rootid[model.jnt_bodyid[joint]] == model.body_rootid[source.base]
        if root and joint not in own and model.jnt_bodyid[joint] != source.base:
            name = model.joint(joint).name
            raise RobotSpecError(f"joint '{name}' is no part of a leg, expected twelve joints only")
    if model.neq or model.ntendon:
        raise RobotSpecError(f"{model.neq} equalities, {model.ntendon} tendons: expected none")
    torques = [torque for leg in legs for torque in leg.torques]
    for joint, torque in zip([j for leg in legs for j in leg.joints], torques, strict=True):
        if not torque > 0.0 and spec.joints.torque is None:
            name = model.joint(joint).name
            raise RobotSpecError(f"joint '{name}': no torque limit, expected one in joints.torque")
    if spec.actuators is not None:
        _check_actuators(model, legs, spec.actuators)


def _check_actuators(model: mujoco.MjModel, legs: list[Leg], names: tuple[str, ...]) -> None:
    joints = [joint for leg in legs for joint in leg.joints]
    if len(names) != len(joints):
        raise RobotSpecError(
            f"actuators: got {len(names)}, expected twelve: hip, thigh, calf of each"
        )
    for name, joint in zip(names, joints, strict=True):
        actuator = find(model, Objects.mjOBJ_ACTUATOR, name)
        if actuator is None:
            raise RobotSpecError(f"actuators: no actuator '{name}' in the MJCF")
        if model.actuator_trnid[actuator, 0] != joint:
            expected = model.joint(joint).name
            raise RobotSpecError(
                f"actuators: '{name}' does not move '{expected}', whose turn it is"
            )


def _check_places(legs: list[Leg], origin: Array) -> None:
    """Check that feet are in order, with hips above, and sides mirror images."""
    shapes = []
    for name, leg in zip(LEGS, legs, strict=True):
        front, side = 1 if name[0] == "F" else -1, 1 if name[1] == "L" else -1
        hip, thigh = leg.anchors[0] - origin, leg.anchors[1] - origin
        if front * thigh[0] <= 0.0 or side * (leg.foot - origin)[1] <= 0.0:
            place = ", ".join(f"{value:.3f}" for value in leg.foot - origin)
            raise RobotSpecError(
                f"feet: {name} is at ({place}) from the hips' middle, "
                "expected front left, front right, rear left, rear right"
            )
        upper, lower = leg.anchors[2] - leg.anchors[1], leg.foot - leg.anchors[2]
        shapes.append(
            (
                front * thigh[0], side * hip[1], side * (leg.foot - leg.anchors[0])[1], hip[2],
                thigh[2], hypot(upper[0], upper[2]), hypot(lower[0], lower[2]), leg.foot_radius,
            )
        )  # fmt: skip
    spread = float(np.ptp(shapes, axis=0).max())
    lift = float(np.abs(np.array(shapes)[:, 3:5]).max())
    if spread > MAX_ASYMMETRY or lift > MAX_ASYMMETRY:
        raise RobotSpecError(f"legs differ by {max(spread, lift):.3f} m, expected mirror images")
    if not np.array(shapes)[:, 5:].min() > 0.0:
        raise RobotSpecError("legs: a link or a foot without length, expected above 0 m")


def _leg(source: Source, name: str, leg: Leg, origin: Array, assets: Assets) -> str:
    text = (
        f'<geom name="{name}_foot" type="sphere" size="{leg.foot_radius!r}" {FOOT_CONTACT} '
        f'pos="{numbers(leg.foot - leg.anchors[2])}"/>'
        f'<site name="{name}_foot" type="sphere" size="{leg.foot_radius + TOUCH_MARGIN!r}" '
        f'pos="{numbers(leg.foot - leg.anchors[2])}"/>'
    )
    for i in (2, 1, 0):
        above = leg.anchors[i - 1] if i else origin
        text = (
            f'<body name="{name}_{JOINTS[i]}" pos="{numbers(leg.anchors[i] - above)}">'
            f"{inertial(source, source.rigid(leg.links[i]), leg.anchors[i])}"
            f"{_joint(source, f'{name}_{JOINTS[i]}', leg, i)}"
            f"{geoms(source, leg.links[i], leg.anchors[i], assets, but=leg.foot_geom)}{text}</body>"
        )
    return text


def _joint(source: Source, name: str, leg: Leg, i: int) -> str:
    model, joint, sign, zero = source.model, leg.joints[i], leg.signs[i], leg.zeros[i]
    address, dof = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
    rest = float(model.qpos0[address])
    text = f'<joint name="{name}" axis="{"1 0 0" if i == 0 else "0 1 0"}" ref="{zero!r}"'
    if model.jnt_limited[joint]:
        ends = sorted(sign * (float(end) - rest) + zero for end in model.jnt_range[joint])
        text += f' range="{numbers(ends)}"'
    stiffness = float(np.ravel(model.jnt_stiffness[joint])[0])
    if stiffness:
        spring = sign * (float(model.qpos_spring[address]) - rest) + zero
        text += f' stiffness="{stiffness!r}" springref="{spring!r}"'
    damping = float(np.ravel(model.dof_damping[dof])[0])
    friction, armature = float(model.dof_frictionloss[dof]), float(model.dof_armature[dof])
    return text + f' damping="{damping!r}" frictionloss="{friction!r}" armature="{armature!r}"/>'
