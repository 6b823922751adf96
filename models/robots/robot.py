"""Interface of a robot: a spec, an MJCF, and a controller behind one call."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol

import mujoco
import numpy as np
from numpy.typing import NDArray

from wayproof.models.sensors.devices import Mount

ROBOT_PREFIX = "robot_"
"""Prefix of every name of the robot in a scene."""


class Setpoint:
    """Commanded state of the body at one instant, as sampled from a trajectory.

    Eight numbers in a row with a name each: two setpoints are made at every physics step, and
    kernels take a row as it is.

    Attributes:
        row: (8,) position, velocity, heading and yaw rate; not to be written.
    """

    __slots__ = ("row",)

    row: NDArray[np.float64]

    def __init__(
        self,
        position: tuple[float, float, float],
        velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
        heading: float = 0.0,
        yaw_rate: float = 0.0,
    ) -> None:
        """Fill the row; the properties state the units."""
        self.row = np.array([*position, *velocity, heading, yaw_rate])

    @classmethod
    def of(cls, row: NDArray[np.float64]) -> Setpoint:
        """Read one out of a row (8,)."""
        setpoint = cls.__new__(cls)
        setpoint.row = row
        return setpoint

    @property
    def position(self) -> tuple[float, float, float]:
        """(x, y, z) world frame, m; ground robots ignore z."""
        x, y, z = self.row[:3].tolist()
        return x, y, z

    @property
    def velocity(self) -> tuple[float, float, float]:
        """(x, y, z) world frame, m/s."""
        x, y, z = self.row[3:6].tolist()
        return x, y, z

    @property
    def heading(self) -> float:
        """Yaw in the world frame, rad."""
        return float(self.row[6])

    @property
    def yaw_rate(self) -> float:
        """Yaw rate, rad/s."""
        return float(self.row[7])

    def __repr__(self) -> str:
        """Show every field by name."""
        motion = f"position={self.position}, velocity={self.velocity}"
        return f"Setpoint({motion}, heading={self.heading}, yaw_rate={self.yaw_rate})"


class SpeedLimits(NamedTuple):
    """Limits of the commanded motion of a body.

    Attributes:
        speed: Greatest speed, m/s.
        acceleration: Greatest acceleration, also across the path, m/s^2.
        jerk: Greatest jerk, m/s^3.
        yaw_rate: Greatest yaw rate, rad/s.
        sideways_speed: Greatest speed in any direction, facing any way, m/s; 0 if it moves ahead
            only.
    """

    speed: float
    acceleration: float
    jerk: float
    yaw_rate: float
    sideways_speed: float = 0.0


@dataclass(frozen=True)
class RobotSpec:
    """The body as the navigation stack knows it.

    Attributes:
        name: Registry name.
        motion: `ground` plans in the plane, `air` in space.
        radius: Circumscribed radius about the base origin (horizontal for ground robots), m.
        height: Top of the body above the ground (ground) or full vertical extent (air), m.
        step_height: Highest thing a foot steps over, m; 0 for robots that fly.
        rest_height: Height of the base origin above the ground when standing or starting, m.
        max_speed: m/s.
        max_acceleration: m/s^2.
        max_jerk: m/s^3.
        max_yaw_rate: rad/s.
        max_tilt: Beyond this angle from upright the robot has fallen, rad.
        mounts: Its sensors, in the order in which their sweeps are integrated; decisions follow the
            rate of the first.
        discs: Offset along the body's x axis and radius of discs that hold a body that is longer
            than wide while it walks ahead and turns, m; as far ahead as behind, so that it is free
            tail first where it is nose first. None: its body is a disc of its radius.
        sideways_speed: Speed in any direction, whatever it faces, m/s; 0 for a body that turns
            before it moves, and for one that flies no faster through a bend than it turns.
        max_yaw_acceleration: Change of the yaw rate while it moves, rad/s^2; 0 for no limit.
    """

    name: str
    motion: Literal["ground", "air"]
    radius: float
    height: float
    step_height: float
    rest_height: float
    max_speed: float
    max_acceleration: float
    max_jerk: float
    max_yaw_rate: float
    max_tilt: float
    mounts: tuple[Mount, ...]
    discs: tuple[tuple[float, float], ...] = ()
    sideways_speed: float = 0.0
    max_yaw_acceleration: float = 0.0


class Controller(Protocol):
    """Turns setpoints into actuator commands; bound to one compiled model."""

    def reset(self, data: mujoco.MjData, position: NDArray[np.float64], heading: float) -> None:
        """Place the robot at rest with its base origin at `position` (3,), facing `heading`."""
        ...

    def follow(self, data: mujoco.MjData, setpoint: Setpoint) -> None:
        """Write the actuator commands (and aerodynamic forces) of one physics step."""
        ...

    def state(self) -> dict[str, NDArray[Any]]:
        """Return copies of all state between steps, by name; MuJoCo's own state apart."""
        ...

    def restore(self, state: dict[str, NDArray[Any]]) -> None:
        """Continue from what `state` returned, bit by bit."""
        ...


class Robot(Protocol):
    """A registry entry."""

    @property
    def spec(self) -> RobotSpec:
        """The body as the navigation stack knows it."""
        ...

    def mjcf(self) -> str:
        """Write the robot alone: root body `base` with a free joint, geoms in ROBOT_GROUP."""
        ...

    def controller(self, model: mujoco.MjModel, prefix: str) -> Controller:
        """Bind to a compiled model in which every name of `mjcf()` carries `prefix`."""
        ...

    def warm_up(self) -> None:
        """Compile the controller's kernels, or load them from the cache."""
        ...
