"""The body of a recorded robot: its size and its limits, from a spec file or a registered robot.

A spec file of a recording needs no model: `name`, `motion`, `radius`, `height` and the `limits` are
enough. The spec file of a simulated robot has them too.
"""

from __future__ import annotations

import hashlib
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import msgspec

from wayproof.harness.config import HASH_SEPARATOR
from wayproof.harness.errors import InputError, unknown_name
from wayproof.models.toml_text import parse_toml

ENDING = ".toml"
"""Suffix of a spec file, given in place of a robot's name."""

MAX_SPEC_BYTES = 2**20

UNUSED: dict[str, Any] = {
    "mjcf": "",
    "base": "",
    "controller": "trot",
    "sensors": [{"name": "none", "device": "ouster-os1-64", "position": [0.0, 0.0, 0.0]}],
}
"""Fields that a simulated robot has to have and a recorded one may leave out."""

LEAST_REACH = 0.5
"""Least share of the radius that the discs reach.

A body within its discs reaches no farther than they do. Radii have some room, 4 % in the specs of
`models.robots.custom.examples`; below half either the radius or a disc is wrong.
"""


@dataclass(frozen=True)
class Body:
    """A body as the stack knows it; see `harness.mission.Mission` for the fields.

    Attributes:
        identity: Name in a log: with the hash of its file, if it is from one.
    """

    identity: str
    motion: Literal["ground", "air"]
    radius: float
    height: float
    step_height: float
    max_speed: float
    max_acceleration: float
    max_jerk: float
    max_yaw_rate: float
    discs: tuple[tuple[float, float], ...]


def find_body(robot: str) -> Body:
    """Read the body of a robot: a spec file, or a registered robot, which loads the simulator.

    Raises:
        InputError: No such robot or file, or a file that is no spec.
    """
    if robot.endswith(ENDING):
        return _from_file(Path(robot))
    from wayproof.harness.config_document import from_document
    from wayproof.harness.scenario.robots import find_robot

    spec = find_robot(from_document({"world": "recording", "robot": robot, "seed": 0})).spec
    names = [name for name in Body.__annotations__ if name != "identity"]
    return Body(robot, **{name: getattr(spec, name) for name in names})


def _from_file(path: Path) -> Body:
    from wayproof.models.robots.custom.source import RobotSpecError
    from wayproof.models.robots.custom.spec_file import parse_spec

    try:
        data = path.read_bytes()
        if len(data) > MAX_SPEC_BYTES:
            raise RobotSpecError(f"{len(data)} bytes, expected a spec file")
        _refuse_unknown(parse_toml(data.decode()))
        spec = parse_spec(data.decode(), UNUSED)
    except OSError as error:
        raise InputError(f"robot '{path}': {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"robot '{path}': no TOML: {error}") from None
    except RobotSpecError as error:
        raise InputError(f"robot '{path}': {error}") from None
    reach = max((abs(offset) + radius for offset, radius in spec.discs), default=spec.radius)
    if reach < LEAST_REACH * spec.radius:
        raise InputError(
            f"robot '{path}': discs: reach {reach:g} m, expected about the radius, "
            f"{spec.radius:g} m, as they hold the whole body"
        )
    return Body(
        identity=f"{spec.name}{HASH_SEPARATOR}{hashlib.sha256(data).hexdigest()[:16]}",
        motion=spec.motion or ("air" if spec.controller == "geometric" else "ground"),
        radius=spec.radius,
        height=spec.height,
        step_height=spec.limits.step_height,
        max_speed=spec.limits.speed,
        max_acceleration=spec.limits.acceleration,
        max_jerk=spec.limits.jerk,
        max_yaw_rate=spec.limits.yaw_rate,
        discs=spec.discs,
    )


def _refuse_unknown(document: dict[str, Any]) -> None:
    """Refuse a field that no spec file has, and name the nearest: it would be at its default."""
    from wayproof.models.robots.custom import spec_file
    from wayproof.models.robots.custom.source import RobotSpecError

    kinds: dict[str, type[msgspec.Struct]] = {
        "limits": spec_file.Limits,
        "sensors": spec_file.Sensor,
        "joints": spec_file.Joints,
        "rotor": spec_file.Rotor,
    }
    tables: list[tuple[str, dict[str, Any], type[msgspec.Struct]]]
    tables = [("", document, spec_file.SpecFile)]
    for name, kind in kinds.items():
        parts = document.get(name)
        for part in parts if isinstance(parts, list) else [parts]:
            if isinstance(part, dict):
                tables.append((f"{name}.", part, kind))
    for prefix, table, kind in tables:
        known = [prefix + field.name for field in msgspec.structs.fields(kind)]
        for key in table:
            if prefix + key not in known:
                raise RobotSpecError(str(unknown_name("field", prefix + key, known)))
