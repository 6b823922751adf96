"""Identity of what a study follows from: Wayproof, and files by their contents, not their paths."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import PurePath

from wayproof.harness.config import PLUGIN, Config
from wayproof.harness.interface.connect import code_digest
from wayproof.harness.log.machine import code_digest as digest_of_program
from wayproof.harness.prediction_config import ONNX_FILE
from wayproof.harness.scenario.robots import ENDING as ROBOT_FILE
from wayproof.harness.scenario.robots import find_robot
from wayproof.harness.scenario.worlds import ENDING as WORLD_FILE
from wayproof.harness.scenario.worlds import find_world
from wayproof.models.robots.custom import CustomRobot
from wayproof.models.world_files import FileWorld

Contents = dict[str, str]
"""Path as given -> name and hash of the file; `PROGRAM` -> digest of Wayproof itself."""

PROGRAM = "wayproof"
"""Key of Wayproof among the contents."""


def named_by(config: Config) -> tuple[str, ...]:
    """Return the names in a config that may be files: world, robot, planner, stack, predictor.

    A predictor that does not run is left out.
    """
    predictor = (config.prediction.source,) if config.runs_predictor else ()
    return config.world, config.robot, config.planner.name, config.stack.name, *predictor


def contents_of(names: Iterable[str]) -> Contents:
    """Return the identities of Wayproof and of the files among names of worlds, robots and so on.

    The hash of a robot covers its spec, its MJCF with meshes, and the code of its controller. The
    hash of a planner, a stack or a predictor covers its code, see `plugin.files_of`; a socket has
    none.

    Raises:
        InputError: A file cannot be read.
    """
    identities = {name: _identity(name) for name in names}
    files = {name: identity for name, identity in identities.items() if identity is not None}
    return {PROGRAM: digest_of_program(), **files}


def _identity(name: str) -> str | None:
    """Return the identity of what may be a file; None if the name is no file."""
    if name.endswith(WORLD_FILE):
        world = find_world(Config(name, "", 0))
        assert isinstance(world, FileWorld)
        return world.identity
    if not name.endswith(ROBOT_FILE):
        digest = code_digest(name) if PLUGIN in name or name.endswith(ONNX_FILE) else ""
        return class_identity(name, digest) if digest else None
    robot = find_robot(Config("", name, 0))
    assert isinstance(robot, CustomRobot)
    controller = robot.file.controller
    own = f" {class_identity(controller, code_digest(controller))}" if PLUGIN in controller else ""
    return f"{robot.identity}{own}"


def class_identity(name: str, digest: str) -> str:
    """Return the name of a class or a network and the hash of its files, without the path."""
    own = name.rpartition(PLUGIN)[2] if PLUGIN in name else PurePath(name).name
    return f"{own} {digest}"
