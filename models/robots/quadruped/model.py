"""MJCF of the quadruped, from primitive shapes and published figures.

Source of every mass, centre of mass, inertia, offset, range and limit: Unitree's public
go2_description URDF (numbers only; front left leg, the others are mirrored). Not from there, and
assumed: joint damping, dry friction, armature, and the foot's friction and contact stiffness.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from wayproof.models.robots.quadruped.parameters import JOINTS, LEGS, Actuators, Geometry
from wayproof.models.sensors.caster import ROBOT_GROUP


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
