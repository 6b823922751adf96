"""Simulation of a quadruped trial: unknown conditions and an estimate with errors."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from tests.tools.trials.estimate import Estimate, EstimateNoise
from tests.tools.trials.terrain import Block
from wayproof.models.arrays import Array
from wayproof.models.robots.quadruped.robot import Quadruped
from wayproof.models.robots.robot import ROBOT_PREFIX, Setpoint

TIMESTEP = 0.002
"""Physics step, s."""

FALL_CHECK_TICKS = 5
"""Ticks between two checks for a fall."""

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


class Conditions(NamedTuple):
    """Physical conditions that the controller does not know."""

    friction: float = 0.8
    payload: float = 0.0
    payload_place: tuple[float, float, float] = (0.0, 0.0, 0.13)
    delay: float = 0.0
    blocks: tuple[Block, ...] = ()


class TrialSim:
    """One run from standing at the origin, tick by tick."""

    def __init__(
        self,
        robot: Quadruped,
        conditions: Conditions,
        noise: EstimateNoise | None,
        seconds: float,
        rng: np.random.Generator,
    ) -> None:
        """Compile the scene and place the robot; without noise the controller reads the truth."""
        self.model = _compile(robot, conditions)
        self.data = mujoco.MjData(self.model)
        nominal = self.model
        if conditions.payload:
            nominal = _compile(robot, conditions._replace(payload=0.0))
        self.controller = robot.controller(nominal, ROBOT_PREFIX)
        start = np.array([0.0, 0.0, robot.spec.rest_height])
        self.controller.reset(self.data, start, 0.0)
        self._estimate = None
        if noise is not None:
            self._estimate = Estimate(nominal, noise, round(seconds / TIMESTEP), rng)
        self._delayed = deque(np.zeros((round(conditions.delay / TIMESTEP), self.model.nu)))
        self._base = self.model.body(f"{ROBOT_PREFIX}base").id
        self._min_upright = math.cos(robot.spec.max_tilt)
        self._forbidden = _trunk_and_hips(self.model)
        self.fallen = False
        self.tick = 0

    def walk(self, command: Array) -> None:
        """Step the physics under a velocity command (3,) in the body's yaw frame."""
        self._step(lambda data: self.controller.walk(data, command))

    def follow(self, setpoint: Setpoint) -> None:
        """Step the physics towards a setpoint."""
        self._step(lambda data: self.controller.follow(data, setpoint))

    def push(self, velocity: Array) -> None:
        """Kick: add (2,) to the base's horizontal velocity at once, m/s."""
        self.data.qvel[:2] += velocity

    def _step(self, act: Callable[[mujoco.MjData], None]) -> None:
        estimate = self.data
        if self._estimate is not None:
            self._estimate.update(self.data, self.tick)
            estimate = self._estimate.data
        act(estimate)
        if self._delayed:
            self._delayed.append(estimate.ctrl.copy())
            self.data.ctrl[:] = self._delayed.popleft()
        elif estimate is not self.data:
            self.data.ctrl[:] = estimate.ctrl
        mujoco.mj_step(self.model, self.data)
        self.tick += 1
        if self.tick % FALL_CHECK_TICKS == 0:
            self.fallen = self.fallen or self._lies()

    def _lies(self) -> bool:
        upright = self.data.xmat[self._base, 8] > self._min_upright  # false for NaN, too
        pairs = self.data.contact.geom[: self.data.ncon]
        return not upright or bool(self._forbidden[pairs].any())


def _compile(robot: Quadruped, conditions: Conditions) -> mujoco.MjModel:
    blocks = "\n".join(block.mjcf(conditions.friction) for block in conditions.blocks)
    scene = _SCENE.format(timestep=TIMESTEP, friction=conditions.friction, blocks=blocks)
    world = mujoco.MjSpec.from_string(scene)
    body = mujoco.MjSpec.from_string(robot.mjcf())
    world.attach(body, prefix=ROBOT_PREFIX, frame=world.worldbody.add_frame())
    if conditions.payload:
        cube = world.body(f"{ROBOT_PREFIX}base").add_body(
            name="payload", pos=conditions.payload_place
        )
        cube.add_geom(
            type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.075, 0.075, 0.075], mass=conditions.payload,
            contype=0, conaffinity=0,
        )  # fmt: skip
    return world.compile()


def _trunk_and_hips(model: mujoco.MjModel) -> NDArray[np.bool_]:  # (ngeom,)
    names = [model.body(int(body)).name for body in model.geom_bodyid]
    return np.array([name == f"{ROBOT_PREFIX}base" or name.endswith("_hip") for name in names])
