"""Identity of what a study follows from: Wayproof, and files by their contents, not their paths."""

from __future__ import annotations

from collections.abc import Iterable

from wayproof.harness.config import PLUGIN, Config
from wayproof.harness.interface.connect import EXEC, SOCKETS, is_ros2
from wayproof.harness.log.machine import code_digest
from wayproof.harness.scenario.robots import ENDING as ROBOT_FILE
from wayproof.harness.scenario.robots import find_robot
from wayproof.harness.scenario.worlds import ENDING as WORLD_FILE
from wayproof.harness.scenario.worlds import find_world
from wayproof.models.robots.custom import CustomRobot
from wayproof.models.world_files import FileWorld
from wayproof.plugin import source_digest

Contents = dict[str, str]
"""Path as given -> name and hash of the file; `PROGRAM` -> digest of Wayproof itself."""

PROGRAM = "wayproof"
"""Key of Wayproof among the contents."""


def named_by(config: Config) -> tuple[str, ...]:
    """Return the names in a config that may be files: world, robot, planner and stack."""
    return config.world, config.robot, config.planner.name, config.stack.name


def contents_of(names: Iterable[str]) -> Contents:
    """Return the identities of Wayproof and of the files among names of worlds, robots and so on.

    The hash of a robot covers its spec, its MJCF with meshes, and the file of its controller's
    class. The hash of a planner or a stack covers the file of its class, not its imports; a command
    or a socket has none.

    Raises:
        InputError: A file cannot be read.
    """
    files = {name: _identity(name) for name in names if _may_be_file(name)}
    return {PROGRAM: code_digest(), **files}


def _may_be_file(name: str) -> bool:
    is_class = PLUGIN in name and not name.startswith((EXEC, *SOCKETS)) and not is_ros2(name)
    return is_class or name.endswith((WORLD_FILE, ROBOT_FILE))


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
    """Return the name of a class and the hash of its file, without the path."""
    return f"{name.rpartition(PLUGIN)[2]} {digest}"
