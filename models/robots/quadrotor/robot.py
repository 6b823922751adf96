"""Registry entry of the drone: spec, MJCF and controller."""

from __future__ import annotations

from dataclasses import dataclass, field

import mujoco
import numpy as np

from wayproof.models.robots.quadrotor.controller import QuadrotorController
from wayproof.models.robots.quadrotor.model import BOTTOM, TOP, circumscribed_radius, quadrotor_mjcf
from wayproof.models.robots.quadrotor.parameters import FAST, Parameters
from wayproof.models.robots.robot import RobotSpec, Setpoint, SpeedLimits
from wayproof.models.sensors.devices import DEVICES, Mount

FULL = SpeedLimits(speed=4.0, acceleration=4.0, jerk=20.0, yaw_rate=1.0, sideways_speed=4.0)
"""Limits well inside the controller's tracking with `FAST`, which leaves navigation a reserve.

Torque about the vertical is scarce: of 24 flights that turned about at 2 rad/s meanwhile, half of
them in gusts, 4 crashed, at 1.5 rad/s 1, of 40 in gusts at 1.25 and at 1.0 none. So it turns slowly
and flies where it does not face yet.
"""

CAUTIOUS = SpeedLimits(speed=2.0, acceleration=2.5, jerk=12.0, yaw_rate=1.5)
"""Limits for the controller with its plain parameters."""


def _spec(parameters: Parameters, limits: SpeedLimits) -> RobotSpec:
    """Return the spec."""
    return RobotSpec(
        name="drone",
        motion="air",
        radius=circumscribed_radius(parameters.airframe),
        height=TOP - BOTTOM,
        step_height=0.0,
        rest_height=1.0,
        max_speed=limits.speed,
        max_acceleration=limits.acceleration,
        max_jerk=limits.jerk,
        max_yaw_rate=limits.yaw_rate,
        max_tilt=1.2,
        sideways_speed=limits.sideways_speed,
        mounts=(
            Mount("lidar", "lidar", DEVICES["ideal-lidar-wide"]),
            Mount("depth", "camera", DEVICES["ideal-depth-camera"]),
            Mount("altimeter", "altimeter", DEVICES["ideal-altimeter"]),
        ),
    )


@dataclass(frozen=True)
class Quadrotor:
    """A 1.3 kg quadrotor under geometric control.

    Attributes:
        parameters: Airframe, gains and smoothing.
        limits: Limits of its commanded motion.
        spec: The body as the navigation stack knows it.
    """

    parameters: Parameters = field(default_factory=Parameters)
    limits: SpeedLimits = CAUTIOUS
    spec: RobotSpec = field(init=False)

    def __post_init__(self) -> None:
        """Derive the spec from the parameters."""
        object.__setattr__(self, "spec", _spec(self.parameters, self.limits))

    def mjcf(self) -> str:
        """Write the robot alone: root body `base` with a free joint, geoms in ROBOT_GROUP."""
        return quadrotor_mjcf(self.parameters.airframe)

    def controller(self, model: mujoco.MjModel, prefix: str) -> QuadrotorController:
        """Bind to a compiled model in which every name of `mjcf()` carries `prefix`."""
        return QuadrotorController(model, prefix, self.parameters)

    def warm_up(self) -> None:
        """Compile the controller's kernels, or load them from the cache."""
        warm_up()


FAST_QUADROTOR = Quadrotor(FAST, FULL)
"""Quadrotor at its full speed."""


def warm_up() -> None:
    """Compile every kernel by taking one tick in the air."""
    quadrotor = Quadrotor()
    model = mujoco.MjModel.from_xml_string(quadrotor.mjcf())
    data = mujoco.MjData(model)
    controller = quadrotor.controller(model, "")
    controller.reset(data, np.zeros(3), 0.0)
    controller.follow(data, Setpoint((0.0, 0.0, 0.0)))
