"""Spec files of robots: TOML with the facts that an MJCF cannot hold."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import msgspec

from wayproof.models.robots.custom.source import RobotSpecError
from wayproof.models.sensors.devices import DEVICES, Mount
from wayproof.models.toml_text import parse_toml
from wayproof.models.world_files.reading import WorldFileError, read_text

CLASS_SEPARATOR = ":"
"""Separator in the name of the user's own controller, `module:Class`."""

MAX_SPEC_BYTES = 2**20
"""Maximum size of a spec file, bytes."""

Vector = tuple[float, float, float]
Four = tuple[str, str, str, str]


class Limits(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Limits on navigation's commands; see `RobotSpec`.

    Attributes:
        speed: m/s.
        acceleration: m/s^2.
        jerk: m/s^3.
        yaw_rate: rad/s.
        tilt: Beyond this angle from upright the robot has fallen, rad.
        step_height: Highest thing that a foot steps over, m.
    """

    speed: float
    acceleration: float
    jerk: float
    yaw_rate: float
    tilt: float = 1.0
    step_height: float = 0.0


class Sensor(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One sensor on the base.

    Attributes:
        name: `lidar`, `depth` or any other.
        device: Name in `models.sensors.devices.DEVICES`.
        position: Position in the base body's frame, m. It looks along the base's x axis, a
            rangefinder down.
    """

    name: str
    device: str
    position: Vector


class Joints(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Limits of the motors of hip, thigh and calf, in place of the MJCF's.

    Attributes:
        torque: Largest torque, Nm.
        speed: No-load speed, rad/s; an MJCF has none, and without one torque never falls off.
    """

    torque: Vector | None = None
    speed: Vector | None = None


class Rotor(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One of four equal rotors, and the air; see `models.robots.quadrotor.Parameters`.

    Attributes:
        radius: m.
        thrust: Largest, N.
        yaw_ratio: Reaction torque by thrust, m; below 0 if the first rotor's torque on the body is
            to the left.
        lag: Time constant of thrust, s.
        drag: Linear drag along the body axes, N s/m.
        body_drag: Quadratic drag in any direction, N s^2/m^2.
    """

    radius: float
    thrust: float
    yaw_ratio: float
    lag: float
    drag: Vector = (0.0, 0.0, 0.0)
    body_drag: float = 0.0


class SpecFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Content of a spec file.

    Attributes:
        name: Name of the robot.
        mjcf: Path from the spec file's folder, or `package:path` in an installed package.
        base: Body with the free joint.
        controller: `trot`, `geometric`, `module:Class` or `path/to/file.py:Class`.
        radius: Circumscribed radius about the base origin, m.
        discs: Offset along the base's x axis and radius of discs that hold a long body as it walks
            ahead and turns, m; none for one disc of the radius.
        height: Top above the ground (ground) or full vertical extent (air), m.
        limits: Limits on navigation's commands.
        sensors: Sensors in the order in which their sweeps are integrated.
        motion: `ground` or `air`, for a controller of the user's own.
        stance: Base origin above the ground in standing, m; a trotting one's is read off its legs.
        swing_height: Foot clearance of `trot` at mid-swing, m; else scaled by the legs' length.
        feet: Feet of `trot`: sphere geoms or sites, front left, front right, rear left, rear right.
        actuators: Actuators of `trot`, to be checked: hip, thigh, calf of each of the feet.
        joints: Joint limits of `trot`, in place of the MJCF's.
        rotors: Rotors of `geometric`: sites, geoms or bodies, rear right, rear left, front left,
            front right.
        rotor: Rotor figures of `geometric`.
    """

    name: str
    mjcf: str
    base: str
    controller: str
    radius: float
    height: float
    limits: Limits
    sensors: tuple[Sensor, ...]
    discs: tuple[tuple[float, float], ...] = ()
    motion: Literal["ground", "air"] | None = None
    stance: float | None = None
    swing_height: float | None = None
    feet: Four | None = None
    actuators: tuple[str, ...] | None = None
    joints: Joints = Joints()
    rotors: Four | None = None
    rotor: Rotor | None = None

    def mounts(self) -> tuple[Mount, ...]:
        """Return the sensors as mounts."""
        return tuple(Mount(s.name, s.name, DEVICES[s.device]) for s in self.sensors)


def read_spec_text(path: Path) -> str:
    """Read the text of a spec file.

    Raises:
        RobotSpecError: No such file, empty, too large, or no UTF-8.
    """
    try:
        return read_text(path, MAX_SPEC_BYTES)
    except WorldFileError as error:
        raise RobotSpecError(str(error).removeprefix(f"{path}: ")) from None


def parse_spec(text: str, unused: Mapping[str, Any] | None = None) -> SpecFile:
    """Read and check a spec file's text; the MJCF is not looked at.

    Args:
        text: TOML.
        unused: Values of fields that it may leave out.

    Raises:
        RobotSpecError: Naming the field, what was got and what was expected.
    """
    try:
        spec = msgspec.convert({**(unused or {}), **parse_toml(text)}, SpecFile)
    except tomllib.TOMLDecodeError as error:
        raise RobotSpecError(f"no TOML: {error}") from None
    except msgspec.ValidationError as error:
        raise RobotSpecError(" ".join(str(error).split())) from None
    _check_name(spec.name)
    for name, number in _positive(spec).items():
        if not 0.0 < number < 1e4:
            raise RobotSpecError(f"{name}: got {number:g}, expected above 0")
    if not 0.0 <= spec.limits.step_height < spec.height:
        raise RobotSpecError(
            f"limits.step_height: got {spec.limits.step_height:g}, expected 0 to height"
        )
    _check_sensors(spec.sensors)
    _check_discs(spec)
    return spec


def _check_discs(spec: SpecFile) -> None:
    for offset, radius in spec.discs:
        if not (abs(offset) <= spec.radius and 0.0 < radius <= spec.radius):
            raise RobotSpecError(
                f"discs: got offset {offset:g} m and radius {radius:g} m, "
                f"expected each within the radius, {spec.radius:g} m"
            )
    if spec.discs and spec.controller == "geometric":
        raise RobotSpecError("discs: expected none for a robot that flies")


def _check_name(name: str) -> None:
    if not name or not name.replace("-", "").replace("_", "").isalnum() or len(name) > 40:
        raise RobotSpecError(f"name: got {name[:50]!r}, expected letters, digits, - and _")


def _positive(spec: SpecFile) -> dict[str, float]:
    own = {"radius": spec.radius, "height": spec.height}
    for name in ("stance", "swing_height"):
        if getattr(spec, name) is not None:
            own[name] = getattr(spec, name)
    names = ("speed", "acceleration", "jerk", "yaw_rate", "tilt")
    own |= {f"limits.{name}": getattr(spec.limits, name) for name in names}
    if spec.rotor is not None:
        own |= {f"rotor.{name}": getattr(spec.rotor, name) for name in ("radius", "thrust", "lag")}
        own["rotor.yaw_ratio (without its sign)"] = abs(spec.rotor.yaw_ratio)
    for name in ("torque", "speed"):
        for number in getattr(spec.joints, name) or ():
            own[f"joints.{name}"] = min(number, own.get(f"joints.{name}", number))
    return own


def _check_sensors(sensors: tuple[Sensor, ...]) -> None:
    if not sensors:
        raise RobotSpecError("sensors: got none, expected one [[sensors]] at least")
    names = [sensor.name for sensor in sensors]
    if len(set(names)) < len(names):
        raise RobotSpecError(f"sensors: got the names {', '.join(names)}, expected different ones")
    for sensor in sensors:
        _check_name(sensor.name)
        if sensor.device not in DEVICES:
            known = ", ".join(DEVICES)
            raise RobotSpecError(f"sensors: unknown device '{sensor.device}' (available: {known})")
        if not all(abs(value) < 1e3 for value in sensor.position):
            raise RobotSpecError(
                f"sensors: position {sensor.position}, expected three numbers in m"
            )
