"""The body of a recorded robot: its size and its limits, from a spec file or a registered robot.

A spec file of a recording needs no model: `name`, `motion`, `radius`, `height` and the `limits` are
enough. The spec file of a simulated robot has them too; its other fields are passed over. A field
of neither is refused: a misspelt one would leave the body at a default.
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

LARGEST = 1e4
"""Bound of sizes and limits as in the spec file of a simulated robot, in the unit of each."""

LEAST_REACH = 0.5
"""Least share of the radius that the discs reach.

A body within its discs reaches no farther than they do. Radii have some room, 4 % in the specs of
`models.robots.custom.examples`; below half either the radius or a disc is wrong.
"""


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
    """A spec file, of which the other fields of a simulated robot are passed over.

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
        document = parse_toml(data.decode())
        _refuse_unknown(path, document)
        spec = msgspec.convert(document, BodyFile)
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"robot '{path}': no TOML: {error}") from None
    except msgspec.ValidationError as error:
        raise InputError(f"robot '{path}': {' '.join(str(error).split())}") from None
    if not spec.name or not spec.name.replace("-", "").replace("_", "").isalnum():
        raise InputError(f"robot '{path}': name {spec.name[:50]!r}, expected letters and digits")
    _check_figures(path, spec)
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


def _refuse_unknown(path: Path, document: dict[str, Any]) -> None:
    """Refuse a field that the spec file of a simulated robot has not either."""
    from wayproof.models.robots.custom import spec_file

    tables: list[tuple[str, dict[str, Any], type[msgspec.Struct]]]
    tables = [("", document, spec_file.SpecFile)]
    parts_of: tuple[tuple[str, type[msgspec.Struct]], ...] = (
        ("limits", spec_file.Limits),
        ("sensors", spec_file.Sensor),
        ("joints", spec_file.Joints),
        ("rotor", spec_file.Rotor),
    )
    for name, part_kind in parts_of:
        found = document.get(name)
        parts = found if isinstance(found, list) else [found]
        tables += [(f"{name}.", part, part_kind) for part in parts if isinstance(part, dict)]
    for prefix, table, kind in tables:
        known = [prefix + field.name for field in msgspec.structs.fields(kind)]
        for key in table:
            if prefix + key not in known:
                raise InputError(f"robot '{path}': {unknown_name('field', prefix + key, known)}")


def _check_figures(path: Path, spec: BodyFile) -> None:
    """Refuse figures that the spec file of a simulated robot may not have, and discs far within."""
    limits = spec.limits
    positive = {"radius": spec.radius, "height": spec.height}
    for name in ("speed", "acceleration", "jerk", "yaw_rate"):
        positive[f"limits.{name}"] = getattr(limits, name)
    for name, value in positive.items():
        if not 0.0 < value < LARGEST:
            what = f"{name}: got {value:g}, expected above 0 and below {LARGEST:g}"
            raise InputError(f"robot '{path}': {what}")
    if not 0.0 <= limits.step_height < spec.height:
        what = f"limits.step_height: got {limits.step_height:g}, expected 0 to height"
        raise InputError(f"robot '{path}': {what}")
    for offset, radius in spec.discs:
        if not (abs(offset) <= spec.radius and 0.0 < radius <= spec.radius):
            raise InputError(
                f"robot '{path}': discs: got offset {offset:g} m and radius {radius:g} m, "
                f"expected each within the radius, {spec.radius:g} m"
            )
    reach = max((abs(offset) + radius for offset, radius in spec.discs), default=spec.radius)
    if reach < LEAST_REACH * spec.radius:
        raise InputError(
            f"robot '{path}': discs: reach {reach:g} m, expected about the radius, "
            f"{spec.radius:g} m, as they hold the whole body"
        )
