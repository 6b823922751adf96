"""The robot of an episode: one of ours by name, read from a spec file, or the one of a log."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Literal

from wayproof.harness.config import HASH_SEPARATOR, Config
from wayproof.harness.errors import InputError, unknown_name
from wayproof.harness.scenario.named import find_named
from wayproof.models.robots import LIMITS_IN_STATIC_WORLDS, ROBOTS, ROBOTS_BY_LIMITS, Robot, custom
from wayproof.models.robots.custom import (
    CustomRobot,
    RobotSpecError,
    kind_of,
    logged_robot,
    parse_spec,
    read_robot,
)
from wayproof.models.robots.custom.spec_file import read_spec_text
from wayproof.models.robots.robot import ROBOT_PREFIX
from wayproof.models.worlds import World

EXAMPLES = Path(custom.__file__).parent / "examples"
"""Spec files of robots whose models are packages of their own."""

ENDING = ".toml"
"""Suffix of a spec file, given in place of a robot's name."""


def find_robot(config: Config) -> Robot:
    """Return the robot that a config names, or that a spec file describes.

    Raises:
        InputError: No such robot or file; or a robot whose spec is only in its log.
    """
    example = EXAMPLES / f"{Path(config.robot).name.lower()}{ENDING}"
    if config.robot not in ROBOTS and example.is_file():
        raise InputError(
            f"unknown robot '{config.robot}'; its spec file is here: --robot {example} "
            f"(available by name: {', '.join(sorted(ROBOTS))})"
        )
    return find_named(
        "robot", name=config.robot, registry=built_in(config), ending=ENDING, read=read_robot
    )


def built_in(config: Config) -> Mapping[str, Robot]:
    """Return the built-in robots by name, with the limits that a config sets."""
    return ROBOTS_BY_LIMITS.get(config.motion.limits, ROBOTS)


def resolve_limits(config: Config, world: World) -> Config:
    """Return the config with the limits that `motion.limits=auto` stands for in a world.

    A robot stops within the space that is admitted. What moves or appears can come into it
    meanwhile, so where the operator knows of such things, the robot goes more slowly. So it does
    where it is to walk on slopes. Elsewhere the registry of robots decides.
    """
    if config.motion.limits != "auto":
        return config
    limits: Literal["full", "cautious", "sloping"]
    if config.costmap.max_slope > 0.0:
        limits = "sloping"
    elif world.movers:
        limits = "cautious"
    else:
        limits = LIMITS_IN_STATIC_WORLDS.get(config.robot, "full")  # no other robot has two
    return replace(config, motion=replace(config.motion, limits=limits))


UNUSED: dict[str, tuple[str, ...]] = {
    "ground": ("motion.altitude_low", "motion.altitude_high"),
    "air": (
        "behaviour.rotate_in_place_angle",
        "behaviour.reverse_speed_fraction",
        "costmap.max_slope",
    ),
}
"""Settings that a robot of this motion does not use."""


def refuse_unused(config: Config, settings: Iterable[str]) -> None:
    """Refuse settings that the user gave and that would change nothing.

    Raises:
        InputError: The robot does not use one of them.
    """
    motion = find_robot(config).spec.motion
    for name in settings:
        if name in UNUSED[motion]:
            kind = "walks" if motion == "ground" else "flies"
            raise InputError(f"--set {name}: '{config.robot}' {kind} and does not use it")


def controller_of(name: str) -> str:
    """Return the controller named by a robot's spec file, without loading it; else empty."""
    if not name.endswith(ENDING):
        return ""
    try:
        return parse_spec(read_spec_text(Path(name))).controller
    except ValueError:
        return ""  # reported when the robot is read


def find_logged_robot(config: Config, scene: str) -> Robot:
    """Return the robot of a log by its config and scene; no file is opened.

    Args:
        config: Config of the log.
        scene: Its flattened MJCF, checked.

    Raises:
        InputError: No such robot, or no spec of it.
    """
    if config.robot in ROBOTS:
        return built_in(config)[config.robot]
    if HASH_SEPARATOR not in config.robot or not config.robot_file:
        raise unknown_name("robot", config.robot, ROBOTS)
    try:
        return logged_robot(config.robot_file, scene, ROBOT_PREFIX)
    except (ValueError, KeyError) as error:
        line = " ".join(str(error).split())[:200]
        raise InputError(f"robot '{config.robot}': {line}") from None


def log_robot_identity(robot: Robot, config: Config) -> Config:
    """Return the config for the log, with the identity and the spec of a robot from a file."""
    if isinstance(robot, CustomRobot):
        return replace(config, robot=robot.identity, robot_file=robot.text)
    return replace(config, robot_file="")


def warm_up_robot(config: Config) -> None:
    """Compile the kernels of the robot's controller, or load them from the cache."""
    if config.robot in ROBOTS:
        ROBOTS[config.robot].warm_up()
        return
    try:
        text = config.robot_file or read_spec_text(Path(config.robot))
        kind_of(parse_spec(text)).warm_up()
    except RobotSpecError:
        return  # reported when the episode is built
