"""Registry entry of the quadruped: spec, MJCF and controller."""

from __future__ import annotations

from dataclasses import dataclass, field

import mujoco

from wayproof.models.robots.quadruped.controller import QuadrupedController
from wayproof.models.robots.quadruped.model import LIDAR_SITE, quadruped_mjcf
from wayproof.models.robots.quadruped.parameters import FAST, Parameters
from wayproof.models.robots.robot import RobotSpec, Setpoint, SpeedLimits
from wayproof.models.sensors.devices import DEVICES, Mount

FULL = SpeedLimits(speed=1.5, acceleration=2.0, jerk=15.0, yaw_rate=1.5, sideways_speed=0.35)
"""Limits well inside the controller's tracking with `FAST`, which leaves navigation a reserve."""

CAUTIOUS = SpeedLimits(speed=1.0, acceleration=1.5, jerk=15.0, yaw_rate=1.0)
"""Limits for the controller with its plain parameters."""

SLOPING = SpeedLimits(speed=0.7, acceleration=1.5, jerk=15.0, yaw_rate=1.0)
"""Limits on slopes: over ridges of 0.25 and 0.28 rad it fell in 5 of 24 walks at 1 m/s."""


def _spec(parameters: Parameters, limits: SpeedLimits, top: float) -> RobotSpec:
    """Return the spec.

    Radius: legs at full stride reached 0.440 m at up to 1.5 m/s and 1.5 rad/s; standing, 0.387 m.
    Discs: at these speeds, and not walking sideways, it reached 0.418 m behind, 0.38 m ahead and
    0.21 m to the sides, and no point of it was farther than 0.236 m from the nearest centre.
    Height: the lidar's top was up to 0.466 m above the ground, 0.445 m in standing. Step height:
    well below what `wayproof bench robots` shows it to cross unseen.
    """
    return RobotSpec(
        name="quadruped",
        motion="ground",
        radius=0.45,
        height=parameters.gait.height + LIDAR_SITE[2] + top,
        step_height=0.03,
        rest_height=parameters.gait.height,
        max_speed=limits.speed,
        max_acceleration=limits.acceleration,
        max_jerk=limits.jerk,
        max_yaw_rate=limits.yaw_rate,
        max_tilt=1.0,
        mounts=(Mount("lidar", "lidar", DEVICES["ideal-lidar-floor"]),),
        sideways_speed=limits.sideways_speed,
        max_yaw_acceleration=parameters.gait.yaw_acceleration,
        discs=((-0.245, 0.235), (0.0, 0.235), (0.245, 0.235)),
    )


@dataclass(frozen=True)
class Quadruped:
    """A 15 kg quadruped with twelve joints that trots under a predictive controller.

    Attributes:
        parameters: Geometry, motors, gait and gains.
        limits: Limits of its commanded motion.
        top: Highest that the body gets above the lidar's site in walking, m.
        spec: The body as the navigation stack knows it.
    """

    parameters: Parameters = field(default_factory=Parameters)
    limits: SpeedLimits = CAUTIOUS
    top: float = 0.04
    spec: RobotSpec = field(init=False)

    def __post_init__(self) -> None:
        """Derive the spec from the parameters."""
        object.__setattr__(self, "spec", _spec(self.parameters, self.limits, self.top))

    def mjcf(self) -> str:
        """Write the robot alone: root body `base` with a free joint, geoms in ROBOT_GROUP."""
        return quadruped_mjcf(self.parameters.geometry, self.parameters.actuators)

    def controller(self, model: mujoco.MjModel, prefix: str) -> QuadrupedController:
        """Bind to a compiled model in which every name of `mjcf()` carries `prefix`."""
        return QuadrupedController(model, prefix, self.parameters)

    def warm_up(self) -> None:
        """Compile the controller's kernels, or load them from the cache."""
        warm_up()


FAST_QUADRUPED = Quadruped(FAST, FULL, top=0.05)
"""Quadruped at its full speed."""

SLOPING_QUADRUPED = Quadruped(limits=SLOPING)
"""Quadruped at the speed that it bears on slopes."""


def warm_up() -> None:
    """Compile every kernel by taking one step on an empty floor."""
    quadruped = Quadruped()
    spec = mujoco.MjSpec.from_string(quadruped.mjcf())
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 1.0])
    model = spec.compile()
    data = mujoco.MjData(model)
    quadruped.controller(model, "").follow(data, Setpoint((0.0, 0.0, 0.0)))
