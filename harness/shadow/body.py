"""The body of a recorded robot: its size and its limits, from a spec file or a registered robot.

A spec file of a recording needs no model: `name`, `motion`, `radius`, `height` and the `limits` are
enough. The spec file of a simulated robot has them too; what else it holds is ignored.
"""

from __future__ import annotations

import hashlib
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import msgspec

from wayproof.harness.config import HASH_SEPARATOR
from wayproof.harness.errors import InputError

ENDING = ".toml"
"""Suffix of a spec file, given in place of a robot's name."""

MAX_SPEC_BYTES = 2**20


class Limits(msgspec.Struct, frozen=True):
    """Limits of the built-in stack's commands.

    Attributes:
        speed: m/s.
        acceleration: m/s^2.
        jerk: m/s^3.
        yaw_rate: rad/s.
        step_height: Highest thing that the body rolls or steps over, m.
    """

    speed: float
    acceleration: float
    jerk: float
    yaw_rate: float
    step_height: float = 0.0


class BodyFile(msgspec.Struct, frozen=True):
    """A spec file, of which other fields are ignored.

    Attributes:
        name: Name of the robot.
        radius: Circumscribed radius about the body's origin, m; horizontal on the ground.
        height: Top above the ground (ground) or full vertical extent (air), m.
        limits: Limits of its commands.
        motion: `ground` or `air`.
        discs: Offset along the x axis and radius of discs that hold a long body, m.
    """

    name: str
    radius: float
    height: float
    limits: Limits
    motion: Literal["ground", "air"] = "ground"
    discs: tuple[tuple[float, float], ...] = ()


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
    return Body(
        identity=robot,
        motion=spec.motion,
        radius=spec.radius,
        height=spec.height,
        step_height=spec.step_height,
        max_speed=spec.max_speed,
        max_acceleration=spec.max_acceleration,
        max_jerk=spec.max_jerk,
        max_yaw_rate=spec.max_yaw_rate,
        discs=spec.discs,
    )


def _from_file(path: Path) -> Body:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"robot '{path}': {error.strerror}") from None
    if len(data) > MAX_SPEC_BYTES:
        raise InputError(f"robot '{path}': {len(data)} bytes, expected a spec file")
    try:
        spec = msgspec.convert(tomllib.loads(data.decode()), BodyFile)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"robot '{path}': no TOML: {error}") from None
    except msgspec.ValidationError as error:
        raise InputError(f"robot '{path}': {' '.join(str(error).split())}") from None
    if not spec.name or not spec.name.replace("-", "").replace("_", "").isalnum():
        raise InputError(f"robot '{path}': name {spec.name[:50]!r}, expected letters and digits")
    limits = spec.limits
    return Body(
        identity=f"{spec.name[:40]}{HASH_SEPARATOR}{hashlib.sha256(data).hexdigest()[:16]}",
        motion=spec.motion,
        radius=spec.radius,
        height=spec.height,
        step_height=limits.step_height,
        max_speed=limits.speed,
        max_acceleration=limits.acceleration,
        max_jerk=limits.jerk,
        max_yaw_rate=limits.yaw_rate,
        discs=spec.discs,
    )
