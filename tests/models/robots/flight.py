"""Quadrotor that flies a course, for tests."""

import mujoco

from wayproof.models.robots.quadrotor import Quadrotor
from wayproof.models.robots.quadrotor.parameters import Airframe, Gains, Smoothing

SCENE = """<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody>
    <body name="decoy" pos="0 0 -5">
      <freejoint/>
      <geom size="0.1" contype="0" conaffinity="0"/>
    </body>
    <geom name="floor" type="plane" size="0 0 1"/>
  </worldbody>
</mujoco>"""
# The decoy's free joint comes first, so that addresses which are assumed and not looked up fail.

TIMESTEP = 0.002
AIRFRAME, GAINS, SMOOTHING = Airframe(), Gains(), Smoothing()


def build(prefix="robot_"):
    quadrotor = Quadrotor()
    world = mujoco.MjSpec.from_string(SCENE)
    drone = mujoco.MjSpec.from_string(quadrotor.mjcf())
    world.attach(drone, prefix=prefix, frame=world.worldbody.add_frame())
    model = world.compile()
    return model, mujoco.MjData(model), quadrotor.controller(model, prefix)
