"""A quadruped on a plant that it does not know, with an estimate that is not the truth."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.robots.estimate import Estimate, EstimateNoise
from wayproof.models.robots.quadruped.robot import Quadruped
from wayproof.models.robots.robot import Setpoint
from wayproof.models.robots.terrain import Block

Array = NDArray[np.float64]

PREFIX = "robot_"
TIMESTEP = 0.002
CHECK_EVERY = 5
"""Ticks between two looks at whether it has fallen."""

_SCENE = """\
<mujoco model="trial">
  <option timestep="{timestep}" integrator="implicitfast" cone="pyramidal" iterations="50"/>
  <default><geom group="0" contype="1" conaffinity="1"/></default>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 0.05" friction="{friction} 0.005 0.0001"/>
    {blocks}
  </worldbody>
</mujoco>
"""


class Plant(NamedTuple):
    """What the controller is not told.

    Attributes:
        friction: Sliding friction coefficient of the ground.
        payload: Mass fixed to the trunk, kg: a cube of 0.15 m on its back.
        payload_place: Of its centre in the body frame, m.
        delay: From command to torque, s.
        blocks: On the floor.
    """

    friction: float = 0.8
    payload: float = 0.0
    payload_place: tuple[float, float, float] = (0.0, 0.0, 0.13)
    delay: float = 0.0
    blocks: tuple[Block, ...] = ()


class Ride:
    """One run from standing at the origin, tick by tick.

    Attributes:
        data: The truth.
        controller: Reads the estimate.
        fallen: Tilted beyond the spec's limit, or trunk or hip on the ground.
        tick: Ticks done.
    """

    def __init__(
        self,
        robot: Quadruped,
        plant: Plant,
        noise: EstimateNoise | None,
        seconds: float,
        rng: np.random.Generator,
    ) -> None:
        """Compile the plant and place the robot; without noise the controller reads the truth."""
        self.model = _compile(robot, plant)
        self.data = mujoco.MjData(self.model)
        nominal = self.model
        if plant.payload:
            nominal = _compile(robot, plant._replace(payload=0.0))
        self.controller = robot.controller(nominal, PREFIX)
        start = np.array([0.0, 0.0, robot.spec.rest_height])
        self.controller.reset(self.data, start, 0.0)
        self._estimate = None
        if noise is not None:
            self._estimate = Estimate(nominal, noise, round(seconds / TIMESTEP), rng)
        self._delayed = deque(np.zeros((round(plant.delay / TIMESTEP), self.model.nu)))
        self._base = self.model.body(f"{PREFIX}base").id
        self._least_upright = math.cos(robot.spec.max_tilt)
        self._forbidden = _trunk_and_hips(self.model)
        self.fallen = False
        self.tick = 0

    def walk(self, command: Array) -> None:
        """One physics step under a velocity command (3,) in the body's yaw frame."""
        self._step(lambda data: self.controller.walk(data, command))

    def follow(self, setpoint: Setpoint) -> None:
        """One physics step towards a setpoint."""
        self._step(lambda data: self.controller.follow(data, setpoint))

    def push(self, velocity: Array) -> None:
        """Kick: add (2,) to the base's horizontal velocity at once, m/s."""
        self.data.qvel[:2] += velocity

    def _step(self, act: Callable[[mujoco.MjData], None]) -> None:
        believed = self.data
        if self._estimate is not None:
            self._estimate.update(self.data, self.tick)
            believed = self._estimate.data
        act(believed)
        if self._delayed:
            self._delayed.append(believed.ctrl.copy())
            self.data.ctrl[:] = self._delayed.popleft()
        elif believed is not self.data:
            self.data.ctrl[:] = believed.ctrl
        mujoco.mj_step(self.model, self.data)
        self.tick += 1
        if self.tick % CHECK_EVERY == 0:
            self.fallen = self.fallen or self._lies()

    def _lies(self) -> bool:
        upright = self.data.xmat[self._base, 8] > self._least_upright  # false for NaN, too
        pairs = self.data.contact.geom[: self.data.ncon]
        return not upright or bool(self._forbidden[pairs].any())


def _compile(robot: Quadruped, plant: Plant) -> mujoco.MjModel:
    blocks = "\n".join(block.mjcf(plant.friction) for block in plant.blocks)
    scene = _SCENE.format(timestep=TIMESTEP, friction=plant.friction, blocks=blocks)
    world = mujoco.MjSpec.from_string(scene)
    body = mujoco.MjSpec.from_string(robot.mjcf())
    world.attach(body, prefix=PREFIX, frame=world.worldbody.add_frame())
    if plant.payload:
        cube = world.body(f"{PREFIX}base").add_body(name="payload", pos=plant.payload_place)
        cube.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.075, 0.075, 0.075], mass=plant.payload,
            contype=0, conaffinity=0,
        )  # fmt: skip
    return world.compile()


def _trunk_and_hips(model: mujoco.MjModel) -> NDArray[np.bool_]:  # (ngeom,)
    names = [model.body(int(body)).name for body in model.geom_bodyid]
    return np.array([name == f"{PREFIX}base" or name.endswith("_hip") for name in names])
