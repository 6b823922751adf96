"""What the files that a study names hold: an episode is known by that, and not by their paths."""

from __future__ import annotations

from collections.abc import Iterable

from wayproof.harness.config import PLUGIN, Config
from wayproof.harness.scenario.robots import ENDING as ROBOT_FILE
from wayproof.harness.scenario.robots import find_robot
from wayproof.harness.scenario.worlds import ENDING as WORLD_FILE
from wayproof.harness.scenario.worlds import find_world
from wayproof.models.robots.custom import CustomRobot
from wayproof.models.world_files import FileWorld
from wayproof.planners.ompl._plugin import source_digest

Contents = dict[str, str]
"""Path as given -> name and hash of what lies there."""


def named_by(config: Config) -> tuple[str, ...]:
    """What a config names that may be a file."""
    return config.world, config.robot, config.planner.name


def contents_of(names: Iterable[str]) -> Contents:
    """Read the files among some names of worlds, robots and planners; others stand for themselves.

    A robot's hash is over its spec, the MJCF that is made of it, meshes and all, and the file of
    its controller's class. A planner's is over the file of its class, not what that imports.

    Raises:
        InputError: A file cannot be read.
    """
    return {name: _identity(name) for name in names if _may_be_file(name)}


def _may_be_file(name: str) -> bool:
    return name.endswith((WORLD_FILE, ROBOT_FILE)) or PLUGIN in name


def _identity(name: str) -> str:
    if name.endswith(WORLD_FILE):
        world = find_world(Config(name, "", 0))
        assert isinstance(world, FileWorld)
        return world.identity
    if not name.endswith(ROBOT_FILE):
        return class_identity(name, source_digest(name))
    robot = find_robot(Config("", name, 0))
    assert isinstance(robot, CustomRobot)
    controller = robot.file.controller
    own = (
        f" {class_identity(controller, source_digest(controller))}" if PLUGIN in controller else ""
    )
    return f"{robot.identity}{own}"


def class_identity(name: str, digest: str) -> str:
    """The class's own name and its file's hash, whose path does not count."""
    return f"{name.rpartition(PLUGIN)[2]} {digest}"
