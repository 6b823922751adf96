"""Robots of the user's own, from a spec file and an MJCF."""

from wayproof.models.robots.brought.robot import CONTROLLERS, BroughtRobot, logged_robot, read_robot
from wayproof.models.robots.brought.source import Unusable
from wayproof.models.robots.brought.spec_file import PLUGIN, SpecFile, parse_spec

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
