"""A quadruped unlike ours: other sizes, names, order, signs, rest pose; with position servos."""

import numpy as np

SPEC = """
name = "hound"
mjcf = "hound.xml"
base = "torso"
controller = "trot"
feet = ["toe_vl", "toe_vr", "toe_hl", "toe_hr"]
radius = 0.4
height = 0.4

[limits]
speed = 0.8
acceleration = 1.2
jerk = 15.0
yaw_rate = 1.0
step_height = 0.03

[[sensors]]
name = "lidar"
device = "ideal-lidar-floor"
position = [0.1, 0.0, 0.1]
"""

LEAN, THIGH, CALF = 0.3, 0.18, 0.17


def hound_leg(name, x, y):
    """Hip and thigh turn the other way round, the calf not; at rest the thigh leans back."""
    knee = f"{-THIGH * np.sin(LEAN)} 0 {-THIGH * np.cos(LEAN)}"
    return f"""
    <body name="a_{name}" pos="{0.16 * x + 0.03} {0.05 * y} 0.02">
      <joint name="roll_{name}" axis="-1 0 0" range="-0.8 0.8" damping="0.1" armature="0.008"/>
      <geom type="capsule" size="0.03" fromto="0 0 0 0 {0.03 * y} 0" mass="0.4"/>
      <body name="b_{name}" pos="0 {0.07 * y} 0">
        <joint name="swing_{name}" axis="0 -1 0" range="-2.5 1.0" damping="0.1" armature="0.008"/>
        <geom type="capsule" size="0.015" fromto="0 0 0 {knee}" mass="0.6"/>
        <body name="c_{name}" pos="{knee}">
          <joint name="knee_{name}" axis="0 1 0" range="-2.3 -0.3" damping="0.1" armature="0.008"/>
          <geom type="capsule" size="0.01" fromto="0 0 0 0 0 {0.02 - CALF}" mass="0.1"/>
          <geom name="toe_{name}" size="0.02" pos="0 0 {-CALF}" mass="0.03"/>
          <geom type="box" size="0.2 0.2 0.2" contype="0" conaffinity="0" mass="0"/>
        </body>
      </body>
    </body>"""


def hound():
    legs = {"hr": (-1, -1), "vl": (1, 1), "hl": (-1, 1), "vr": (1, -1)}
    servos = "".join(
        f'<position name="{joint}_{leg}" joint="{joint}_{leg}" kp="50" forcerange="-20 20"/>'
        for joint in ("knee", "roll", "swing")
        for leg in legs
    )
    return f"""<mujoco model="hound">
  <compiler angle="radian" autolimits="true"/>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="torso" pos="0 0 1">
      <freejoint/>
      <geom type="box" size="0.18 0.06 0.05" pos="0.03 0 0.02" mass="5"/>
      {"".join(hound_leg(name, *sides) for name, sides in legs.items())}
    </body>
  </worldbody>
  <actuator>{servos}</actuator>
</mujoco>"""
