"""Spec files checked, and proposed from an MJCF: base, feet or rotors, space of the body."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import mujoco

from wayproof.models.robots.custom.legged import legged_mjcf
from wayproof.models.robots.custom.robot import read_robot
from wayproof.models.robots.custom.rotorcraft import find_rotors, propose_craft
from wayproof.models.robots.custom.source import RobotSpecError, find_mjcf, open_source
from wayproof.models.robots.custom.spec_file import SpecFile, parse_spec, read_spec_text
from wayproof.models.robots.custom.walker import (
    LIMITS,
    ROOM,
    find_feet,
    propose_walker,
    stride_findings,
    walked,
)


class Proposal(NamedTuple):
    """A spec for an MJCF.

    Attributes:
        spec: The spec.
        notes: Assumptions and measurements, a line each.
    """

    spec: SpecFile
    notes: list[str]

    def toml(self) -> str:
        """Return the spec file's text, with the notes as comments."""
        given = msgspec.to_builtins(self.spec)
        tables = {name: given.pop(name) for name in ("limits", "joints", "rotor")}
        tables = {f"[{name}]": table or {} for name, table in tables.items()}
        parts = [*tables.items(), *(("[[sensors]]", one) for one in given.pop("sensors"))]
        lines = [*(f"# {note}" for note in self.notes), *_rows(given)]
        for head, table in parts:
            if rows := _rows(table):
                lines += ["", head, *rows]
        return "\n".join(lines) + "\n"


def _rows(table: dict[str, Any]) -> list[str]:
    """Return the lines of all that a table states, numbers to six digits."""
    stated = {name: value for name, value in table.items() if value not in (None, ())}
    return [f"{name} = {_toml(value)}" for name, value in stated.items()]


def _toml(value: Any) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, float):
        return f"{value:g}"
    return f"[{', '.join(map(_toml, value))}]"


def propose(named: str, folder: Path) -> Proposal:
    """Propose a spec for an MJCF.

    Args:
        named: As a spec file names it: from the folder, or `package:path`.
        folder: Folder that the spec file will lie in.

    Raises:
        RobotSpecError: Neither four legs nor four rotors were found, or the body does not fit the
            controller; the message is one line.
    """
    path = find_mjcf(named, folder)
    base = _base(path)
    source = open_source(path, base, folder)
    spec = SpecFile(
        name="".join(c if c.isalnum() or c in "-_" else "-" for c in path.stem)[:40],
        mjcf=named, base=base, controller="", radius=ROOM, height=ROOM, limits=LIMITS, sensors=(),
    )  # fmt: skip
    if rotors := find_rotors(source):
        spec, notes = propose_craft(source, spec, rotors)
        return Proposal(spec, [f"proposed for {path.name}", *notes])
    feet = find_feet(source)
    if len(feet) == 4:
        spec, notes = propose_walker(source, spec, feet)
        return Proposal(spec, [f"proposed for {path.name}", *notes])
    raise RobotSpecError(
        f"mjcf '{path.name}': found {len(feet)} legs of three hinges below '{base}', and no four "
        "rotors (sites with a thruster, or sites, bodies or geoms named rotor, motor or prop), "
        "expected four of one; another robot needs a controller of its own"
    )


def _base(path: Path) -> str:
    """Return the body that moves freely: the one with a free joint, or the first of the world."""
    try:
        tree = mujoco.MjSpec.from_file(str(path))
    except (ValueError, RuntimeError) as error:
        raise RobotSpecError(f"mjcf '{path}': {' '.join(str(error).split())[:300]}") from None
    bodies = list(tree.worldbody.bodies)
    free = [b for b in bodies if any(j.type == mujoco.mjtJoint.mjJNT_FREE for j in b.joints)]
    chosen = free or [body for body in bodies if not body.joints]
    if not chosen or not chosen[0].name:
        raise RobotSpecError(f"mjcf '{path.name}': no body with a name and a free joint")
    return str(chosen[0].name)


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
        spec = parse_spec(read_spec_text(path))
    except RobotSpecError as error:
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
