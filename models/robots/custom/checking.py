"""Check of a spec file: everything that is wrong with it at once, and a spec that would do."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

import msgspec

from wayproof.models.robots.custom.legged import legged_mjcf
from wayproof.models.robots.custom.proposal import Proposal, propose
from wayproof.models.robots.custom.robot import read_robot
from wayproof.models.robots.custom.source import RobotSpecError, find_mjcf, open_source
from wayproof.models.robots.custom.spec_file import SpecFile, parse_spec
from wayproof.models.robots.custom.stride import stride_findings, walked
from wayproof.models.robots.custom.walker_proposal import ROOM
from wayproof.models.world_files.reading import WorldFileError, read_text

MAX_SPEC_BYTES = 2**20
"""Maximum size of a spec file, bytes."""


class Checked(NamedTuple):
    """Result of a check.

    Attributes:
        wrong: Faults, a line each.
        proposal: A spec made from the MJCF alone, if that is possible.
        unproposed: Reason why there is none; else empty.
    """

    wrong: list[str]
    proposal: Proposal | None
    unproposed: str


def check_spec(path: Path, folder: Path | None = None) -> Checked:
    """Check a spec file, or propose one for an MJCF.

    Args:
        path: TOML of a robot, or an MJCF.
        folder: Folder for which an MJCF's spec is proposed; None for its own.
    """
    if path.suffix in (".xml", ".mjcf"):
        folder = path.parent if folder is None else folder
        return _proposed([], os.path.relpath(path.resolve(), folder.resolve()), folder)
    try:
        spec = parse_spec(read_text(path, MAX_SPEC_BYTES))
    except (RobotSpecError, WorldFileError) as error:
        return Checked([str(error)], None, "the spec could not be read")
    wrong = _walking_findings(spec, path.parent) if spec.controller == "trot" else []
    if not wrong:
        try:
            read_robot(path)
        except RobotSpecError as error:
            wrong = [str(error)]
    return _proposed(wrong, spec.mjcf, path.parent)


def _walking_findings(spec: SpecFile, folder: Path) -> list[str]:
    """Walk the robot of a spec with room to spare, and compare."""
    roomy = msgspec.structs.replace(spec, radius=ROOM, height=ROOM, discs=())
    try:
        source = open_source(find_mjcf(spec.mjcf, folder), spec.base, folder)
        mjcf = legged_mjcf(source, roomy)
    except RobotSpecError as error:
        return [str(error)]
    return stride_findings(spec, walked(mjcf, roomy))


def _proposed(wrong: list[str], mjcf: str, folder: Path) -> Checked:
    try:
        return Checked(wrong, propose(mjcf, folder), "")
    except RobotSpecError as error:
        return Checked(wrong, None, str(error))
