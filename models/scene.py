"""Scenes: a world and a robot compiled into one MuJoCo model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mujoco
import numpy as np

from wayproof.models.classes import CLASSES
from wayproof.models.robots import Controller, Robot
from wayproof.models.robots.robot import ROBOT_PREFIX
from wayproof.models.sensors.caster import Caster, make_caster
from wayproof.models.sensors.devices import DEVICES, OWN, Device, Mount, SensorConfig
from wayproof.models.worlds import World

FLOOR = CLASSES.index("floor")


@dataclass(frozen=True)
class Scene:
    """A simulated scene: model, controller and sensors.

    Attributes:
        model: The compiled model.
        mjcf: The scene in MJCF, flattened: one file with no reference outside itself.
        controller: The robot's controller, bound to the model.
        casters: Casters of the sensors, in the order in which their sweeps are integrated.
        base: Body id of the robot's base.
        floor: Ids of the geoms that may be stepped on: those of class `floor`.
    """

    model: mujoco.MjModel
    mjcf: str
    controller: Controller
    casters: tuple[Caster, ...]
    base: int
    floor: tuple[int, ...]


def compose(world: World, robot: Robot, sensors: SensorConfig | None = None) -> Scene:
    """Attach the robot to the world and compile.

    Raises:
        ValueError: A device does not fit its mount, or the ray engine cannot cast the model.
    """
    spec = mujoco.MjSpec.from_string(world.mjcf())
    robot_spec = mujoco.MjSpec.from_string(robot.mjcf())
    spec.attach(robot_spec, prefix=ROBOT_PREFIX, frame=spec.worldbody.add_frame())
    spec.compile()
    return bind(spec.to_xml(), robot, sensors)


def bind(mjcf: str, robot: Robot, sensors: SensorConfig | None = None) -> Scene:
    """Compile a flattened scene and bind the robot's controller and sensors to it.

    Writing a scene as text rounds its numbers, so what is simulated is compiled from the text: the
    scene in a log is then the very one that its episode saw.

    Raises:
        ValueError: The text is no scene of this robot, or a device does not fit it.
        KeyError: It lacks one of the names.
    """
    sensors = sensors or SensorConfig()
    model = mujoco.MjModel.from_xml_string(mjcf)
    base = model.body(ROBOT_PREFIX + "base").id
    return Scene(
        model=model,
        mjcf=mjcf,
        controller=robot.controller(model, ROBOT_PREFIX),
        casters=tuple(
            make_caster(model, mount, base, ROBOT_PREFIX, sensors)
            for mount in mount_devices(robot.spec.mounts, sensors)
        ),
        base=base,
        floor=tuple(np.flatnonzero(model.geom_user[:, 0] == FLOOR).tolist()),
    )


def mount_devices(mounts: tuple[Mount, ...], sensors: SensorConfig) -> tuple[Mount, ...]:
    """Return a robot's mounts with the devices that the config names.

    Raises:
        ValueError: The robot has no such mount, or the device is one that MuJoCo measures, for
            which the robot's MJCF has no sensor.
    """
    fitting = [name for name, device in DEVICES.items() if not device.by_mujoco]
    own = {mount.name: mount for mount in mounts}
    for name in ("lidar", "depth"):
        device = getattr(sensors, name)
        if device == OWN:
            continue
        if name not in own:
            raise ValueError(
                f"sensors.{name}: got '{device}', but the robot has no mount '{name}' "
                f"(available: {', '.join(own)})"
            )
        if device not in fitting:
            raise ValueError(
                f"sensors.{name}: got '{device}', expected a lidar or a camera "
                f"(available: {', '.join(fitting)})"
            )
        own[name] = replace(own[name], device=DEVICES[device])
    return tuple(own.values())


def resolve(mounts: tuple[Mount, ...], sensors: SensorConfig) -> SensorConfig:
    """Return the config with the robot's own devices named instead of `own`."""
    names = {mount.name: device_name(mount.device) for mount in mount_devices(mounts, sensors)}
    return replace(sensors, lidar=names.get("lidar", OWN), depth=names.get("depth", OWN))


def device_name(device: Device) -> str:
    """Return the name of a device in `DEVICES`; `own` if it is not there."""
    return next((name for name, known in DEVICES.items() if known == device), OWN)
