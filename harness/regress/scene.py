"""A failure as a scenario whose parts can be taken away: settings, solids, movers, ends."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np

from wayproof.harness.config import Config
from wayproof.harness.config_document import as_asked
from wayproof.harness.errors import InputError
from wayproof.harness.geometry import yaw_of_quaternion
from wayproof.harness.log.reader import Log
from wayproof.harness.recompute.rebuild import rebuild
from wayproof.harness.scenario.worlds import apply_world_perturbation, generate
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.models.world_files import WorldFileError
from wayproof.models.world_files.options import Ends, Found
from wayproof.models.world_files.world_file import file_of, parts_in, world_text
from wayproof.models.world_parameters import WorldParameters
from wayproof.models.worlds import WORLDS

NAME = "shrunk"
"""Name of the world in the file."""


@dataclass(frozen=True)
class Place:
    """A place on the driven way: (x, y) in m, the heading in rad, world frame, and when, s."""

    x: float
    y: float
    heading: float
    time: float


@dataclass(frozen=True)
class Case:
    """A scenario that failed, with its world as parts.

    Attributes:
        config: Settings as they were asked for; the world's own are those of the file.
        found: Solids and movers of the world.
        ends: Operating area, start and goal.
        way: Places that the robot truly passed, a decision each, up to the one of the cause.
    """

    config: Config
    found: Found
    ends: Ends
    way: tuple[Place, ...]

    def text(self) -> str:
        """Return the world file."""
        return world_text(self.found, self.ends, NAME)

    def write(self, folder: Path) -> Config:
        """Write the world file, named after its text, and return the config that names it."""
        text = self.text()
        path = folder / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.xml"
        if not path.is_file():
            path.write_text(text, encoding="utf-8")
        return replace(self.config, world=str(path))


def case_of(log: Log, decision: int, robot: str | None = None) -> Case:
    """Return the scenario of a log of a failure.

    What a perturbation added to the world is part of the world from here on.

    Args:
        log: The log.
        decision: Decision of the cause.
        robot: Spec file of the robot, if it is the user's own.

    Raises:
        InputError: The log is of a recording or forked, or its robot is a file that is not given.
    """
    if log.config.recording is not None:
        raise InputError(
            f"log '{log.path}': of a recording, which nothing simulates; expected an episode "
            "('wayproof regress' makes a test of a recording)"
        )
    if log.forks:
        raise InputError(f"log '{log.path}': forked, expected an episode of one config")
    config = replace(log.config, robot_file="", prior_map=b"")
    if log.asked:
        config = as_asked(config, log.asked)
    if log.config.robot_file:
        if robot is None:
            raise InputError(f"log '{log.path}': robot '{log.config.robot}', expected --robot FILE")
        config = replace(config, robot=robot)
    if isinstance(config.goal, str) or any(isinstance(one, str) for one in config.waypoints):
        config = replace(config, goal=log.config.goal, waypoints=log.config.waypoints)
    perturbation = config.perturbation
    try:
        if config.world in WORLDS:
            plain = generate(config)
            world = apply_world_perturbation(plain, config)
            if world is not plain:
                perturbation = None
            found = parts_in(mujoco.MjModel.from_xml_string(file_of(world)), log.path)
        else:
            scene = rebuild(log).scene
            found = parts_in(scene.model, log.path, scene.base)
    except WorldFileError as error:
        raise InputError(str(error)) from None
    ends = found.ends()
    assert ends is not None
    return Case(
        config=replace(config, world_parameters=WorldParameters(), perturbation=perturbation),
        found=replace(found, notes=[], route_length=None, source=log.config.world),
        ends=ends,
        way=_way(log, decision),
    )


def _way(log: Log, decision: int) -> tuple[Place, ...]:
    return tuple(place_of(truth) for truth in log.truth() if truth.sequence <= decision)


def place_of(truth: pb.Truth) -> Place:
    """Return where a robot truly was."""
    x, y, _ = truth.position
    heading = yaw_of_quaternion(np.array(truth.quaternion))
    return Place(x, y, heading, truth.timestamp.ToNanoseconds() * 1e-9)
