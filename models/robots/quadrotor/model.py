"""MJCF of the quadrotor, from primitive shapes."""

from __future__ import annotations

from math import ceil, hypot

from wayproof.models.robots.quadrotor.parameters import Airframe
from wayproof.models.sensors.caster import ROBOT_GROUP

ROTORS = (
    ("rear_right", -1, -1, -1),
    ("rear_left", -1, 1, 1),
    ("front_left", 1, 1, -1),
    ("front_right", 1, -1, 1),
)
"""Name, sign of x, sign of y and sign of the reaction torque, in the order of every rotor array."""

TOP, BOTTOM = 0.10, -0.10
"""Height of the lidar and of the skids in the body frame, m."""

ROTOR_THICKNESS = 0.02
"""Thickness of the space that a rotor sweeps, m."""


def circumscribed_radius(airframe: Airframe) -> float:
    """Return the radius about the base origin of rotors, lidar and skids, m, rounded up to cm."""
    blade_tip = hypot(airframe.arm_x, airframe.arm_y) + airframe.rotor_radius
    return ceil(100.0 * hypot(blade_tip, ROTOR_THICKNESS)) / 100.0


def quadrotor_mjcf(airframe: Airframe) -> str:
    """Write the robot alone: root body `base`, no floor, no physics options.

    Robot geoms have conaffinity only: they meet the world (contype 1) but not one another. The
    rangefinder leaves from a site whose z axis points down, out of the belly.
    """
    inertia = " ".join(map(str, airframe.inertia))
    arms = "".join(_arm(airframe, name, x, y) for name, x, y, _ in ROTORS)
    motors = "".join(rotor_motor(airframe, name, spin) for name, _, _, spin in ROTORS)
    return f"""<mujoco model="quadrotor">
  <compiler angle="radian" autolimits="true"/>
  <default>
    <geom group="{ROBOT_GROUP}" contype="0" conaffinity="1" condim="3" mass="0"/>
  </default>
  <worldbody>
    <body name="base">
      <freejoint name="root"/>
      <inertial pos="0 0 0" mass="{airframe.mass}" diaginertia="{inertia}"/>
      <geom name="hull" type="box" size="0.11 0.05 0.03"/>
      <geom name="lidar" type="cylinder" size="0.04 0.035" pos="0 0 {TOP - 0.035}"/>
      <geom name="left_skid" type="box" size="0.10 0.01 0.035" pos="0 0.05 {BOTTOM + 0.035}"/>
      <geom name="right_skid" type="box" size="0.10 0.01 0.035" pos="0 -0.05 {BOTTOM + 0.035}"/>
      <site name="lidar" pos="0 0 {TOP - 0.035}"/>
      <site name="camera" pos="0.11 0 0"/>
      <site name="altimeter" pos="0 0 {BOTTOM}" zaxis="0 0 -1"/>{arms}
    </body>
  </worldbody>
  <actuator>{motors}
  </actuator>
  <sensor>
    <rangefinder name="altimeter" site="altimeter"/>
  </sensor>
</mujoco>"""


def _arm(airframe: Airframe, name: str, x: int, y: int) -> str:
    at = f"{x * airframe.arm_x} {y * airframe.arm_y} 0"
    disc = f"{airframe.rotor_radius} {ROTOR_THICKNESS / 2}"
    return f"""
      <geom name="{name}_arm" type="capsule" size="0.01" fromto="0 0 0 {at}"/>
      <geom name="{name}_disc" type="cylinder" size="{disc}" pos="{at}"/>
      <site name="{name}" pos="{at}"/>"""


def rotor_motor(airframe: Airframe, name: str, spin: int) -> str:
    """Write the actuator at a rotor's site: thrust behind its lag, and its reaction torque."""
    return f"""
    <general name="{name}" site="{name}" gear="0 0 1 0 0 {spin * airframe.yaw_ratio}"
             ctrlrange="0 {airframe.thrust_max}" dyntype="filterexact"
             dynprm="{airframe.rotor_lag}" gaintype="fixed" gainprm="1" biastype="none"/>"""
