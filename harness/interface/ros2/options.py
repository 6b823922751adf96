"""Options of `--stack ros2:KEY=VALUE,...`: where the topics are, and the pace."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import Literal, get_args

from wayproof.harness.errors import InputError

Pace = Literal["auto", "lockstep", "controller"]

TOPICS = (
    "clock",
    "tf",
    "tf_static",
    "odom",
    "task",
    "scan",
    "points",
    "points/ranges",
    "depth/image",
    "depth/image/ranges",
    "depth/camera_info",
    "map",
    "referee/costmap",
    "goal_pose",
    "cmd_vel",
    "plan",
    "local_costmap/costmap",
)
"""Topics by the name that they have without a remapping, as Nav2 has them."""

RANGES = "/ranges"
"""End of the topic of a sensor's sweeps as they were measured, beside its points or images."""

MAX_DOMAIN = 232
"""Highest domain: the ports of a higher one do not exist (RTPS 2.2, section 9.6.1.1)."""

NAME = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")


@dataclass(frozen=True)
class Options:
    """Connection of a stack of ROS 2 nodes.

    Attributes:
        domain: DDS domain.
        namespace: Namespace of all topics but `/clock`, without slashes around; empty: none.
        pace: `lockstep`: each sweep waits for the command with its stamp; `controller`: simulated
            time goes on to the next controller period, and waits for a command made in it; `auto`:
            by the stamp of the first command.
        controller_frequency: Frequency of a controller with a timer of its own, Hz; Nav2's default.
        silence: Wall time after which a controller period without a command passes, s; 0: never,
            so that the machine's speed decides nothing.
        map_frame: Frame of the map.
        odom_frame: Frame of the odometry.
        base_frame: Frame of the robot.
        topics: Names by `TOPICS`, where remapped; empty: the topic is not used.
    """

    domain: int = 0
    namespace: str = ""
    pace: Pace = "auto"
    controller_frequency: float = 20.0
    silence: float = 0.0
    map_frame: str = "map"
    odom_frame: str = "odom"
    base_frame: str = "base_link"
    topics: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))

    def topic(self, name: str) -> str:
        """Return the full name of a topic; empty if unused. Ranges stay beside their points."""
        beside = name.removesuffix(RANGES)
        if beside != name and name not in self.topics:
            return self.topic(beside) and self.topic(beside) + RANGES
        remapped = self.topics.get(name, name)
        if remapped.startswith("/") or not remapped:
            return remapped
        inside = self.namespace and name != "clock"
        return f"/{self.namespace}/{remapped}" if inside else f"/{remapped}"


def parse(name: str) -> Options:
    """Return options of a stack's name, such as `ros2:namespace=robot1,cmd_vel=/my_cmd`.

    Raises:
        InputError: A key or a value is none.
    """
    _, _, text = name.partition(":")
    given: dict[str, str] = {}
    for part in filter(None, text.split(",")):
        key, equals, value = part.partition("=")
        if not equals:
            raise InputError(f"--stack {name}: got '{part}', expected KEY=VALUE")
        given[key.strip().removeprefix("/")] = value.strip()
    settings = [one.name for one in fields(Options) if one.name != "topics"]
    if unknown := sorted(set(given) - {*settings, *TOPICS}):
        known = ", ".join([*settings, *TOPICS])
        raise InputError(f"--stack {name}: got '{unknown[0]}', expected one of {known}")
    domain = os.environ.get("ROS_DOMAIN_ID") or "0"
    topics = {key: _name(name, key, given[key]) for key in TOPICS if key in given}
    return Options(
        domain=int(_number(name, given, key="domain", default=domain, most=MAX_DOMAIN)),
        namespace=_name(name, "namespace", given.get("namespace", "")).strip("/"),
        pace=_pace(name, given.get("pace", "auto")),
        controller_frequency=_frequency(name, given),
        silence=_number(name, given, key="silence", default="0", most=3600.0),
        map_frame=_frame(name, "map_frame", given.get("map_frame", Options.map_frame)),
        odom_frame=_frame(name, "odom_frame", given.get("odom_frame", Options.odom_frame)),
        base_frame=_frame(name, "base_frame", given.get("base_frame", Options.base_frame)),
        topics=MappingProxyType(topics),
    )


def _name(stack: str, key: str, value: str) -> str:
    if value and not NAME.fullmatch(value):
        raise InputError(f"--stack {stack}: {key}: got '{value}', expected a ROS name")
    return value


def _frame(stack: str, key: str, value: str) -> str:
    if not value:
        raise InputError(f"--stack {stack}: {key}: got nothing, expected the name of a frame")
    return _name(stack, key, value)


def _pace(stack: str, value: str) -> Pace:
    for pace in get_args(Pace):
        if value == pace:
            return value  # type: ignore[return-value]
    expected = ", ".join(get_args(Pace))
    raise InputError(f"--stack {stack}: pace: got '{value}', expected one of {expected}")


def _frequency(stack: str, given: Mapping[str, str]) -> float:
    frequency = _number(stack, given, key="controller_frequency", default="20", most=1000.0)
    if frequency < 1.0:
        raise InputError(
            f"--stack {stack}: controller_frequency: got {frequency:g}, expected 1 to 1000 Hz"
        )
    return frequency


def _number(stack: str, given: Mapping[str, str], key: str, default: str, most: float) -> float:
    text = given.get(key, default)
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    whole = key != "domain" or value.is_integer()
    if not (0.0 <= value <= most and whole):
        raise InputError(f"--stack {stack}: {key}: got '{text}', expected 0 to {most:g}")
    return value
