"""Simulation of a quadruped trial: unknown conditions and an estimate with errors.

Terrain is walked over blindly, along +x from flat floor about the origin to `COURSE_END`.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from math import cos, pi, sin
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from tests.tools.trials.estimate import Estimate, EstimateNoise
from wayproof.models.arrays import Array, Vector3
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


FIRST = 0.7
"""Minimum distance of blocks from the origin, m."""

COURSE_END = 5.0
"""Distance along x at which the course is crossed, m."""

HALF_WIDTH = 1.5
"""Half the width of a course, m."""


class Block(NamedTuple):
    """A solid box."""

    centre: Vector3
    half_extents: Vector3
    yaw: float = 0.0
    pitch: float = 0.0

    def mjcf(self, friction: float) -> str:
        """Return the `<geom>` element."""
        cy, sy, cp, sp = *_half(self.yaw), *_half(self.pitch)
        quaternion = cy * cp, -sy * sp, cy * sp, sy * cp
        return (
            f'<geom type="box" pos="{_numbers(self.centre)}" size="{_numbers(self.half_extents)}" '
            f'quat="{_numbers(quaternion)}" friction="{friction} 0.005 0.0001"/>'
        )


def planks(rng: np.random.Generator, height: float = 0.03) -> tuple[Block, ...]:
    """Return planks 10 cm wide across the way, 0.3 to 0.8 m apart, up to 0.3 rad askew."""
    blocks, x = [], FIRST
    while x < COURSE_END - 0.5:
        half = 0.05, HALF_WIDTH, height / 2
        blocks.append(Block((x, 0.0, height / 2), half, yaw=rng.uniform(-0.3, 0.3)))
        x += rng.uniform(0.3, 0.8)
    return tuple(blocks)


def stairs(rng: np.random.Generator, rise: float = 0.08) -> tuple[Block, ...]:
    """Return four steps up, a landing, four down; treads of 0.28 to 0.36 m, alike in a flight."""
    blocks, x = [], rng.uniform(FIRST, FIRST + 0.3)
    tread, landing, steps = rng.uniform(0.28, 0.36), rng.uniform(0.6, 0.9), 4
    length = landing + 2 * steps * tread
    for step in range(steps):
        low, high = x + step * tread, x + length - step * tread
        half = (high - low) / 2, HALF_WIDTH, rise / 2
        blocks.append(Block(((low + high) / 2, 0.0, (step + 0.5) * rise), half))
    return tuple(blocks)


def rubble(rng: np.random.Generator, height: float = 0.05) -> tuple[Block, ...]:
    """Return blocks up to `height` high, 0.1 to 0.3 m long, askew, on a third of the floor."""
    blocks, area = [], 0.0
    while area < 0.33 * (COURSE_END - 0.5 - FIRST) * 2 * 0.8:
        half = rng.uniform(0.05, 0.15), rng.uniform(0.05, 0.15), rng.uniform(0.1, 0.5) * height
        x, y = rng.uniform(FIRST, COURSE_END - 0.5), rng.uniform(-0.8, 0.8)
        blocks.append(Block((x, y, half[2]), half, yaw=rng.uniform(0.0, pi)))
        area += 4 * half[0] * half[1]
    return tuple(blocks)


def ramps(rng: np.random.Generator, slope: float = 0.3) -> tuple[Block, ...]:
    """Return a ramp up, a level, and a ramp down again."""
    start, length, level = rng.uniform(FIRST, FIRST + 0.3), 1.4, rng.uniform(0.5, 0.8)
    top, run, half = length * sin(slope), length * cos(slope), 0.1
    across, deep = half * sin(slope), half * cos(slope)

    def side(x: float, up: int) -> Block:
        centre = x + up * across, 0.0, top / 2 - deep
        return Block(centre, (length / 2, HALF_WIDTH, half), pitch=-up * slope)

    end = start + 2 * run + level
    table = Block(((start + end) / 2, 0.0, top / 2), (level / 2, HALF_WIDTH, top / 2))
    return side(start + run / 2, 1), table, side(end - run / 2, -1)


TERRAINS: dict[str, Callable[[np.random.Generator], tuple[Block, ...]]] = {
    "planks": planks,
    "stairs": stairs,
    "rubble": rubble,
    "ramps": ramps,
}
"""Terrains by name."""


def _half(angle: float) -> tuple[float, float]:
    return cos(angle / 2), sin(angle / 2)


def _numbers(values: tuple[float, ...]) -> str:
    return " ".join(f"{value:.6f}" for value in values)
