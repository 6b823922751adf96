"""The quadruped in the registry: spec, and MJCF from primitive shapes and published figures.

Source of every mass, centre of mass, inertia, offset, range and limit: Unitree's public
go2_description URDF (numbers only; front left leg, the others are mirrored). Not from there, and
assumed: joint damping, dry friction, armature, and the foot's friction and contact stiffness.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import mujoco

from wayproof.models.robots.quadruped.controller import QuadrupedController
from wayproof.models.robots.quadruped.parameters import (
    FAST,
    JOINTS,
    LEGS,
    Actuators,
    Geometry,
    Parameters,
)
from wayproof.models.robots.robot import RobotSpec, Setpoint, SpeedLimits
from wayproof.models.sensors.caster import ROBOT_GROUP
from wayproof.models.sensors.devices import DEVICES, Mount


class Link(NamedTuple):
    """Inertial figures of one link in its own frame.

    Attributes:
        mass: kg.
        centre: (x, y, z) centre of mass, m.
        inertia: (xx, yy, zz, xy, xz, yz) about the centre of mass, kg m^2.
    """

    mass: float
    centre: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]

    def mirrored(self, x: int, y: int) -> Link:
        """Return the same link across the planes x = 0 and y = 0; each sign is +1 or -1."""
        cx, cy, cz = self.centre
        xx, yy, zz, xy, xz, yz = self.inertia
        return Link(self.mass, (x * cx, y * cy, cz), (xx, yy, zz, x * y * xy, x * xz, y * yz))

    def mjcf(self) -> str:
        """Write the `<inertial>` element."""
        return (
            f'<inertial pos="{_numbers(self.centre)}" mass="{self.mass}" '
            f'fullinertia="{_numbers(self.inertia)}"/>'
        )


BASE = Link(
    6.921,
    (0.021112, 0.0, -0.005366),
    (0.02448, 0.098077, 0.107, 0.00012166, 0.0014849, -3.12e-05),
)
HIP = Link(
    0.678,
    (-0.0054, 0.00194, -0.000105),
    (0.00048, 0.000884, 0.000596, -3.01e-06, 1.11e-06, -1.42e-06),
)
THIGH = Link(
    1.152,
    (-0.00374, -0.0223, -0.0327),
    (0.00584, 0.0058, 0.00103, 8.72e-05, -0.000289, 0.000808),
)
CALF = Link(
    0.154,
    (0.00548, -0.000975, -0.115),
    (0.00108, 0.0011, 3.29e-05, 3.4e-07, 1.72e-05, 8.28e-06),
)
FOOT = Link(0.04, (0.0, 0.0, 0.0), (9.6e-06, 9.6e-06, 9.6e-06, 0.0, 0.0, 0.0))

HIP_RANGE = (-1.0472, 1.0472)
FRONT_THIGH_RANGE = (-1.5708, 3.4907)
REAR_THIGH_RANGE = (-0.5236, 4.5379)
CALF_RANGE = (-2.7227, -0.83776)

JOINT_DYNAMICS = 'damping="0.1" frictionloss="0.2" armature="0.01"'
FOOT_CONTACT = 'friction="0 0 0" solmix="1000" solref="0.01 1"'
"""Contact parameters of a foot; friction is the ground's, as a contact takes the greater of the
two."""

TOUCH_MARGIN = 0.006
"""Excess of the touch site's radius over the foot's, so that it holds every contact point, m."""

LIDAR_SITE = (0.15, 0.0, 0.12)


def quadruped_mjcf(geometry: Geometry, actuators: Actuators) -> str:
    """Write the robot alone: root body `base`, no floor, no physics options.

    Args:
        geometry: Leg geometry.
        actuators: Torque limits; the motors' control range.
    """
    legs = "".join(_leg(name, geometry) for name in LEGS)
    motors = "".join(
        f'<motor name="{leg}_{joint}" joint="{leg}_{joint}" ctrlrange="{-torque} {torque}"/>'
        for leg in LEGS
        for joint, torque in zip(JOINTS, actuators.torque, strict=True)
    )
    touch = "".join(f'<touch name="{leg}_touch" site="{leg}_foot"/>' for leg in LEGS)
    # Robot geoms have conaffinity only: they meet the world (contype 1) but not one another.
    return f"""<mujoco model="quadruped">
  <compiler angle="radian" autolimits="true"/>
  <default>
    <geom group="{ROBOT_GROUP}" contype="0" conaffinity="1" condim="3" mass="0"/>
    <default class="foot"><geom {FOOT_CONTACT}/></default>
  </default>
  <worldbody>
    <body name="base">
      <freejoint name="root"/>
      {BASE.mjcf()}
      <geom name="trunk" type="box" size="0.1881 0.04675 0.057"/>
      <geom name="head" type="capsule" size="0.047" fromto="0.24 0 0 0.285 0 0"/>
      <geom name="lidar" type="cylinder" size="0.04 0.045" pos="{LIDAR_SITE[0]} 0 0.1"/>
      <site name="lidar" pos="{_numbers(LIDAR_SITE)}"/>
      {legs}
    </body>
  </worldbody>
  <actuator>{motors}</actuator>
  <sensor>{touch}</sensor>
</mujoco>"""


def _leg(name: str, geometry: Geometry) -> str:
    x = 1 if name[0] == "F" else -1
    y = 1 if name[1] == "L" else -1
    g = geometry
    thigh_range = FRONT_THIGH_RANGE if x > 0 else REAR_THIGH_RANGE
    return f"""
      <body name="{name}_hip" pos="{x * g.hip_x} {y * g.hip_y} 0">
        {HIP.mirrored(x, y).mjcf()}
        {_joint(f"{name}_hip", "1 0 0", HIP_RANGE)}
        <geom type="cylinder" size="0.046 0.02" pos="0 {y * 0.08} 0" zaxis="0 1 0"/>
        <body name="{name}_thigh" pos="0 {y * g.thigh_y} 0">
          {THIGH.mirrored(1, y).mjcf()}
          {_joint(f"{name}_thigh", "0 1 0", thigh_range)}
          <geom type="capsule" size="0.017" fromto="0 0 -0.02 0 0 {0.02 - g.thigh_length}"/>
          <body name="{name}_calf" pos="0 0 {-g.thigh_length}">
            {CALF.mirrored(1, y).mjcf()}
            {_joint(f"{name}_calf", "0 1 0", CALF_RANGE)}
            <geom type="capsule" size="0.012" fromto="0 0 -0.01 0 0 {0.03 - g.calf_length}"/>
            <body name="{name}_foot" pos="0 0 {-g.calf_length}">
              {FOOT.mjcf()}
              <geom name="{name}_foot" class="foot" size="{g.foot_radius}"/>
              <site name="{name}_foot" type="sphere" size="{g.foot_radius + TOUCH_MARGIN}"/>
            </body>
          </body>
        </body>
      </body>"""


def _joint(name: str, axis: str, limits: tuple[float, float]) -> str:
    return f'<joint name="{name}" axis="{axis}" range="{_numbers(limits)}" {JOINT_DYNAMICS}/>'


def _numbers(values: Iterable[float]) -> str:
    return " ".join(str(value) for value in values)


FULL = SpeedLimits(speed=1.5, acceleration=2.0, jerk=15.0, yaw_rate=1.5, sideways_speed=0.35)
"""Limits well inside the controller's tracking with `FAST`, which leaves navigation a reserve."""

CAUTIOUS = SpeedLimits(speed=1.0, acceleration=1.5, jerk=15.0, yaw_rate=1.0)
"""Limits for the controller with its plain parameters."""

SLOPING = SpeedLimits(speed=0.7, acceleration=1.5, jerk=15.0, yaw_rate=1.0)
"""Limits on slopes: over ridges of 0.25 and 0.28 rad it fell in 5 of 24 walks at 1 m/s."""


def _spec(parameters: Parameters, limits: SpeedLimits, top: float) -> RobotSpec:
    """Return the spec.

    Radius: legs at full stride reached 0.440 m at up to 1.5 m/s and 1.5 rad/s; standing, 0.387 m.
    Discs: at these speeds, and not walking sideways, it reached 0.418 m behind, 0.38 m ahead and
    0.21 m to the sides, and no point of it was farther than 0.236 m from the nearest centre.
    Height: the lidar's top was up to 0.466 m above the ground, 0.445 m in standing. Step height:
    well below what `wayproof bench robots` shows it to cross unseen.
    """
    return RobotSpec(
        name="quadruped",
        motion="ground",
        radius=0.45,
        height=parameters.gait.height + LIDAR_SITE[2] + top,
        step_height=0.03,
        rest_height=parameters.gait.height,
        max_speed=limits.speed,
        max_acceleration=limits.acceleration,
        max_jerk=limits.jerk,
        max_yaw_rate=limits.yaw_rate,
        max_tilt=1.0,
        mounts=(Mount("lidar", "lidar", DEVICES["ideal-lidar-floor"]),),
        sideways_speed=limits.sideways_speed,
        max_yaw_acceleration=parameters.gait.yaw_acceleration,
        discs=((-0.245, 0.235), (0.0, 0.235), (0.245, 0.235)),
    )


@dataclass(frozen=True)
class Quadruped:
    """A 15 kg quadruped with twelve joints that trots under a predictive controller.

    Attributes:
        parameters: Geometry, motors, gait and gains.
        limits: Limits of its commanded motion.
        top: Highest that the body gets above the lidar's site in walking, m.
        spec: The body as the navigation stack knows it.
    """

    parameters: Parameters = field(default_factory=Parameters)
    limits: SpeedLimits = CAUTIOUS
    top: float = 0.04
    spec: RobotSpec = field(init=False)

    def __post_init__(self) -> None:
        """Derive the spec from the parameters."""
        object.__setattr__(self, "spec", _spec(self.parameters, self.limits, self.top))

    def mjcf(self) -> str:
        """Write the robot alone: root body `base` with a free joint, geoms in ROBOT_GROUP."""
        return quadruped_mjcf(self.parameters.geometry, self.parameters.actuators)

    def controller(self, model: mujoco.MjModel, prefix: str) -> QuadrupedController:
        """Bind to a compiled model in which every name of `mjcf()` carries `prefix`."""
        return QuadrupedController(model, prefix, self.parameters)

    def warm_up(self) -> None:
        """Compile the controller's kernels, or load them from the cache."""
        warm_up()


FAST_QUADRUPED = Quadruped(FAST, FULL, top=0.05)
"""Quadruped at its full speed."""

SLOPING_QUADRUPED = Quadruped(limits=SLOPING)
"""Quadruped at the speed that it bears on slopes."""


def warm_up() -> None:
    """Compile every kernel by taking one step on an empty floor."""
    quadruped = Quadruped()
    spec = mujoco.MjSpec.from_string(quadruped.mjcf())
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0])
    model = spec.compile()
    data = mujoco.MjData(model)
    quadruped.controller(model, "").follow(data, Setpoint((0.0, 0.0, 0.0)))
