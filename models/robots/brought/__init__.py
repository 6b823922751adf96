"""Robots of the user's own, from a spec file and an MJCF."""

from models.robots.brought.robot import CONTROLLERS, BroughtRobot, logged_robot, read_robot
from models.robots.brought.source import Unusable
from models.robots.brought.spec_file import PLUGIN, SpecFile, parse_spec

__all__ = [
    "CONTROLLERS",
    "PLUGIN",
    "BroughtRobot",
    "SpecFile",
    "Unusable",
    "logged_robot",
    "parse_spec",
    "read_robot",
]
