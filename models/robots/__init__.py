"""Robots by name; a new one is a sub-package and a line here."""

from typing import Literal

from wayproof.models.robots.quadrotor import Quadrotor
from wayproof.models.robots.quadrotor.robot import FAST_QUADROTOR
from wayproof.models.robots.quadruped import Quadruped
from wayproof.models.robots.quadruped.robot import FAST_QUADRUPED, SLOPING_QUADRUPED
from wayproof.models.robots.robot import Controller, Robot, RobotSpec, Setpoint

ROBOTS: dict[str, Robot] = {
    "drone": Quadrotor(),
    "quadruped": Quadruped(),
}

FAST_ROBOTS: dict[str, Robot] = {
    "drone": FAST_QUADROTOR,
    "quadruped": FAST_QUADRUPED,
}
"""Built-in robots at the speed that they were measured to bear."""

ROBOTS_BY_LIMITS: dict[str, dict[str, Robot]] = {
    "full": FAST_ROBOTS,
    "cautious": ROBOTS,
    "sloping": {**ROBOTS, "quadruped": SLOPING_QUADRUPED},
}
"""Built-in robots by `motion.limits`."""

LIMITS_IN_STATIC_WORLDS: dict[str, Literal["full", "cautious"]] = {
    "drone": "full",
    "quadruped": "full",
}
"""Limits that `motion.limits=auto` stands for where nothing is known to move: `full` once neither
trials along the paths of navigation nor episodes showed a fall at `FAST_ROBOTS`."""

__all__ = [
    "FAST_ROBOTS",
    "LIMITS_IN_STATIC_WORLDS",
    "ROBOTS",
    "ROBOTS_BY_LIMITS",
    "Controller",
    "Robot",
    "RobotSpec",
    "Setpoint",
]
