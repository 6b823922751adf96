"""The registry entry: spec, MJCF and controller of the drone."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import mujoco
import numpy as np

from models.robots.quadrotor.controller import QuadrotorController
from models.robots.quadrotor.model import BOTTOM, TOP, circumscribed_radius, quadrotor_mjcf
from models.robots.quadrotor.parameters import Parameters
from models.robots.robot import RobotSpec, Setpoint
from models.sensors import DepthCamera, Lidar, Rangefinder

LIDAR = Lidar(
    name="lidar",
    site="lidar",
    rings=32,
    azimuths=512,
    elevation_low=math.radians(-45.0),
    elevation_high=math.radians(45.0),
    range=12.0,
    rate=10.0,
    source="Ouster OS0-32 data sheet: 32 rings over 90 degrees, 512 columns, 10 Hz; range cut",
)

DEPTH = DepthCamera(
    name="depth",
    site="camera",
    height=48,
    width=64,
    field_of_view_horizontal=math.radians(87.0),
    field_of_view_vertical=math.radians(58.0),
    range=6.0,
    rate=10.0,
    source="Intel RealSense D455 data sheet: 87 x 58 degrees, ideal range to 6 m; binned pixels",
)

ALTIMETER = Rangefinder(
    name="altimeter",
    range=10.0,
    rate=20.0,
    source="assumed: a single-beam time-of-flight sensor of the 12 m class, such as TFmini-S",
)


def _spec(parameters: Parameters) -> RobotSpec:
    """Limits well inside what the controller tracks, so that navigation leaves it room."""
    return RobotSpec(
        name="drone",
        motion="air",
        radius=circumscribed_radius(parameters.airframe),
        height=TOP - BOTTOM,
        step_height=0.0,
        rest_height=1.0,
        max_speed=2.0,
        max_acceleration=2.5,
        max_jerk=12.0,
        max_yaw_rate=1.5,
        max_tilt=1.2,
        sweep_sensors=(LIDAR, DEPTH),
        rangefinders=(ALTIMETER,),
    )


@dataclass(frozen=True)
class Quadrotor:
    """A 1.3 kg quadrotor under geometric control.

    Attributes:
        parameters: Airframe, gains and smoothing.
        spec: The body as the navigation stack knows it.
    """

    parameters: Parameters = field(default_factory=Parameters)
    spec: RobotSpec = field(init=False)

    def __post_init__(self) -> None:
        """Derive the spec from the parameters."""
        object.__setattr__(self, "spec", _spec(self.parameters))

    def mjcf(self) -> str:
        """The robot alone, as MJCF: root body `base` with a free joint, geoms in ROBOT_GROUP."""
        return quadrotor_mjcf(self.parameters.airframe)

    def controller(self, model: mujoco.MjModel, prefix: str) -> QuadrotorController:
        """Bind to a compiled model in which every name of `mjcf()` carries `prefix`."""
        return QuadrotorController(model, prefix, self.parameters)

    def warm_up(self) -> None:
        """Compile the controller's kernels, or load them from the cache."""
        warm_up()


def warm_up() -> None:
    """Compile every kernel by taking one tick in the air."""
    quadrotor = Quadrotor()
    model = mujoco.MjModel.from_xml_string(quadrotor.mjcf())
    data = mujoco.MjData(model)
    controller = quadrotor.controller(model, "")
    controller.reset(data, np.zeros(3), 0.0)
    controller.follow(data, Setpoint(np.zeros(3), np.zeros(3), 0.0, 0.0))
