"""Robots by name; a new one is a sub-package and a line here."""

from wayproof.models.robots.quadrotor import Quadrotor
from wayproof.models.robots.quadruped import Quadruped
from wayproof.models.robots.robot import Controller, Robot, RobotSpec, Setpoint

ROBOTS: dict[str, Robot] = {
    "drone": Quadrotor(),
    "quadruped": Quadruped(),
}

__all__ = ["ROBOTS", "Controller", "Robot", "RobotSpec", "Setpoint"]
