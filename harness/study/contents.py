"""What the files that a study names hold: an episode is known by that, and not by their paths."""

from __future__ import annotations

from collections.abc import Iterable

from harness.config import Config
from harness.robots import ENDING as ROBOT_FILE
from harness.robots import find_robot
from harness.worlds import ENDING as WORLD_FILE
from harness.worlds import find_world
from models.imports import FileWorld
from models.robots.brought import BroughtRobot

Contents = dict[str, str]
"""Path as given -> name and hash of what lies there."""


def contents_of(names: Iterable[str]) -> Contents:
    """Read the world and robot files among some names; the others stand for themselves.

    A robot's hash is over its spec and the MJCF that is made of it, meshes and all.

    Raises:
        InputError: A file cannot be read.
    """
    return {name: _identity(name) for name in names if name.endswith((WORLD_FILE, ROBOT_FILE))}


def _identity(name: str) -> str:
    if name.endswith(WORLD_FILE):
        world = find_world(Config(name, "", 0))
        assert isinstance(world, FileWorld)
        return world.identity
    robot = find_robot(Config("", name, 0))
    assert isinstance(robot, BroughtRobot)
    return robot.identity
