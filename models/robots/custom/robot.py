"""Robots of the user's own, behind the interface of the built-in ones."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple

import mujoco

from wayproof.models.robots import quadrotor, quadruped
from wayproof.models.robots.custom.legged import check_legged, legged_mjcf
from wayproof.models.robots.custom.legged_parameters import legged_parameters
from wayproof.models.robots.custom.own_controller import kept_mjcf, load_controller
from wayproof.models.robots.custom.rotorcraft import (
    check_rotorcraft,
    rotorcraft_mjcf,
    rotorcraft_parameters,
)
from wayproof.models.robots.custom.source import RobotSpecError, Source, find_mjcf, open_source
from wayproof.models.robots.custom.spec_file import (
    CLASS_SEPARATOR,
    SpecFile,
    parse_spec,
    read_spec_text,
)
from wayproof.models.robots.custom.walker import stride_findings, walked
from wayproof.models.robots.quadrotor import QuadrotorController
from wayproof.models.robots.quadruped import QuadrupedController
from wayproof.models.robots.robot import Controller, RobotSpec

START_ALTITUDE = 1.0
"""Altitude at which a flying robot starts, m."""

HASH_DIGITS = 12
"""Number of hex digits of the hash in a robot's name."""


class Kind(NamedTuple):
    """Functions of a controller's kind of robot.

    Attributes:
        motion: Ground or air; None for what the spec says.
        mjcf: Writes the robot again.
        check: Refuses a spec that the written robot does not fit.
        rest_height: Height of the base at the start, m.
        controller: Binds to a compiled model.
        warm_up: Compiles its kernels.
    """

    motion: Literal["ground", "air"] | None
    mjcf: Callable[[Source, SpecFile], str]
    check: Callable[[SpecFile, mujoco.MjModel], None]
    rest_height: Callable[[SpecFile, mujoco.MjModel, str], float]
    controller: Callable[[SpecFile, mujoco.MjModel, str], Controller]
    warm_up: Callable[[], None]


def _trot(spec: SpecFile, model: mujoco.MjModel, prefix: str) -> Controller:
    return QuadrupedController(model, prefix, legged_parameters(model, prefix, spec))


def _geometric(spec: SpecFile, model: mujoco.MjModel, prefix: str) -> Controller:
    return QuadrotorController(model, prefix, rotorcraft_parameters(model, prefix, spec))


def _own(spec: SpecFile, model: mujoco.MjModel, prefix: str) -> Controller:
    return load_controller(spec.controller, model, prefix)


def _stance(spec: SpecFile, model: mujoco.MjModel, prefix: str) -> float:
    return legged_parameters(model, prefix, spec).gait.height


def _given(spec: SpecFile, model: mujoco.MjModel, prefix: str) -> float:
    return START_ALTITUDE if spec.stance is None else spec.stance


CONTROLLERS: dict[str, Kind] = {
    "geometric": Kind(
        "air", rotorcraft_mjcf, check_rotorcraft, _given, _geometric, quadrotor.warm_up
    ),
    "trot": Kind("ground", legged_mjcf, check_legged, _stance, _trot, quadruped.warm_up),
}
"""Built-in controllers by the name that a spec gives."""

OWN = Kind(None, kept_mjcf, lambda spec, model: None, _given, _own, lambda: None)
"""A controller of the user's own."""


def kind_of(spec: SpecFile) -> Kind:
    """Return the kind of a robot by its controller."""
    return CONTROLLERS.get(spec.controller, OWN)


@dataclass(frozen=True)
class CustomRobot:
    """A robot made of a spec file and an MJCF.

    Attributes:
        text: Text of the spec file.
        file: The spec file, parsed.
        rest_height: m.
        mjcf_text: The robot alone; empty if it is the one in a log's scene.
        spec: The body as the navigation stack knows it.
    """

    text: str
    file: SpecFile
    rest_height: float
    mjcf_text: str = field(default="", repr=False)

    @property
    def identity(self) -> str:
        """Name and a hash of the spec and the MJCF."""
        both = f"{self.text}\0{self.mjcf_text}".encode()
        return f"{self.file.name}@{hashlib.sha256(both).hexdigest()[:HASH_DIGITS]}"

    @property
    def spec(self) -> RobotSpec:
        """The body as the navigation stack knows it."""
        file, limits = self.file, self.file.limits
        return RobotSpec(
            name=file.name,
            motion=kind_of(file).motion or file.motion or "ground",
            radius=file.radius,
            height=file.height,
            step_height=limits.step_height,
            rest_height=self.rest_height,
            max_speed=limits.speed,
            max_acceleration=limits.acceleration,
            max_jerk=limits.jerk,
            max_yaw_rate=limits.yaw_rate,
            max_tilt=limits.tilt,
            mounts=file.mounts(),
            discs=file.discs,
        )

    def mjcf(self) -> str:
        """Return the robot alone as MJCF: root body `base` with a free joint, geoms in ROBOT_GROUP.

        Raises:
            ValueError: It was read from a log, whose scene has it.
        """
        if not self.mjcf_text:
            raise ValueError(f"robot '{self.file.name}': only its log's scene has it")
        return self.mjcf_text

    def controller(self, model: mujoco.MjModel, prefix: str) -> Controller:
        """Bind to a compiled model in which every name of `mjcf()` carries `prefix`.

        Raises:
            ValueError: The user's own cannot be loaded.
        """
        return kind_of(self.file).controller(self.file, model, prefix)

    def warm_up(self) -> None:
        """Compile the controller's kernels, or load them from the cache."""
        kind_of(self.file).warm_up()


def read_robot(path: Path) -> CustomRobot:
    """Read a robot from its spec file and the MJCF that it names.

    Raises:
        RobotSpecError: One of them cannot be used; the message is one line.
    """
    text = read_spec_text(path)
    spec = _parse(text)
    source = open_source(find_mjcf(spec.mjcf, path.parent), spec.base, path.parent)
    mjcf = kind_of(spec).mjcf(source, spec)
    rest_height = _rest_height(spec, mjcf)
    if spec.controller == "trot" and spec.discs:
        wrong = [text for text in stride_findings(spec, walked(mjcf, spec)) if "discs" in text]
        if wrong:
            raise RobotSpecError(wrong[0])
    return CustomRobot(text, spec, rest_height, mjcf)


def logged_robot(text: str, scene: str, prefix: str) -> CustomRobot:
    """Read a robot from the spec and the scene in a log.

    Args:
        text: Text of the spec file.
        scene: Flattened MJCF with the robot in it.
        prefix: Prefix of the robot's names there.

    Raises:
        ValueError: The spec cannot be used, or the scene does not compile or is of another robot.
        KeyError: The scene lacks one of the robot's names.
    """
    spec = _parse(text)
    return CustomRobot(text, spec, _rest_height(spec, scene, prefix))


def _parse(text: str) -> SpecFile:
    spec = parse_spec(text)
    if spec.controller not in CONTROLLERS and CLASS_SEPARATOR not in spec.controller:
        known = ", ".join([*CONTROLLERS, "module:Class", "FILE.py:Class"])
        raise RobotSpecError(f"controller: unknown '{spec.controller}' (available: {known})")
    if (kind_of(spec).motion or spec.motion) == "ground" and not spec.limits.step_height > 0.0:
        raise RobotSpecError("limits.step_height: got 0, expected above 0 on the ground")
    return spec


def _rest_height(spec: SpecFile, mjcf: str, prefix: str = "") -> float:
    try:
        model = mujoco.MjModel.from_xml_string(mjcf)
    except ValueError as error:
        raise RobotSpecError(f"mjcf: {' '.join(str(error).split())[:300]}") from None
    if not prefix:
        kind_of(spec).check(spec, model)
    return kind_of(spec).rest_height(spec, model, prefix)
