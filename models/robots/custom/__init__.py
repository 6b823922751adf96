"""Robots of the user's own, from a spec file and an MJCF."""

from wayproof.models.robots.custom.robot import (
    CONTROLLERS,
    CustomRobot,
    kind_of,
    logged_robot,
    read_robot,
)
from wayproof.models.robots.custom.source import RobotSpecError
from wayproof.models.robots.custom.spec_file import CLASS_SEPARATOR, SpecFile, parse_spec

__all__ = [
    "CLASS_SEPARATOR",
    "CONTROLLERS",
    "CustomRobot",
    "RobotSpecError",
    "SpecFile",
    "kind_of",
    "logged_robot",
    "parse_spec",
    "read_robot",
]
