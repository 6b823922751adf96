"""A world and a robot compiled into one MuJoCo model."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco

from models.beams import SensorConfig
from models.robots import Controller, Robot
from models.sensors import Caster, RangefinderCaster, SweepCaster
from models.worlds import World

PREFIX = "robot_"
"""Before every name of the robot, so that a world may use any name itself."""


@dataclass(frozen=True)
class Scene:
    """What an episode simulates.

    Attributes:
        model: The compiled model.
        mjcf: The same, flattened: one file with no reference outside itself.
        controller: The robot's controller, bound to the model.
        casters: One for each sensor, in the order in which their sweeps are integrated.
        base: Body id of the robot's base.
        floor: Geom id of the floor.
    """

    model: mujoco.MjModel
    mjcf: str
    controller: Controller
    casters: tuple[Caster, ...]
    base: int
    floor: int


def compose(world: World, robot: Robot, sensors: SensorConfig | None = None) -> Scene:
    """Attach the robot to the world and compile.

    Raises:
        ValueError: The ray engine in `sensors`, by default `tile`, cannot cast the model.
    """
    engine = (sensors or SensorConfig()).engine
    spec = mujoco.MjSpec.from_string(world.mjcf())
    robot_spec = mujoco.MjSpec.from_string(robot.mjcf())
    spec.attach(robot_spec, prefix=PREFIX, frame=spec.worldbody.add_frame())
    model = spec.compile()
    sweep_casters = [
        SweepCaster(model, sensor, PREFIX, engine) for sensor in robot.spec.sweep_sensors
    ]
    rangefinders = [RangefinderCaster(model, sensor, PREFIX) for sensor in robot.spec.rangefinders]
    return Scene(
        model=model,
        mjcf=spec.to_xml(),
        controller=robot.controller(model, PREFIX),
        casters=(*sweep_casters, *rangefinders),
        base=model.body(PREFIX + "base").id,
        floor=model.geom("floor").id,
    )
