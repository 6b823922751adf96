"""Options of `--stack ros2:KEY=VALUE,...`: where the topics are, and the pace."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Annotated, Literal, get_args

import msgspec

from wayproof.bounds import Bounds, check_fields
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

FRAMES = ("map_frame", "odom_frame", "base_frame")


@dataclass(frozen=True)
class Options:
    """Connection of a stack of ROS 2 nodes.

    Attributes:
        domain: DDS domain.
        namespace: Namespace of all topics but `/clock`, without slashes around; empty: none.
        pace: `lockstep`: each sweep waits for the command with its stamp; `controller`: simulated
            time runs on to the next controller period, and waits for a command made in it; `auto`:
            by the stamp of the first command.
        controller_frequency: Frequency of a controller with a timer of its own, Hz; Nav2's default.
        silence: Wall time after which a controller period without a command passes, s; 0: never,
            so that the machine's speed decides nothing.
        map_frame: Frame of the map.
        odom_frame: Frame of the odometry.
        base_frame: Frame of the robot.
        topics: Names by `TOPICS`, where remapped; empty: the topic is not used.
    """

    domain: Annotated[int, Bounds(0, MAX_DOMAIN)] = 0
    namespace: str = ""
    pace: Pace = "auto"
    controller_frequency: Annotated[float, Bounds(1.0, 1000.0, "Hz")] = 20.0
    silence: Annotated[float, Bounds(0.0, 3600.0, "s")] = 0.0
    map_frame: str = "map"
    odom_frame: str = "odom"
    base_frame: str = "base_link"
    topics: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check every field."""
        check_fields(self, "")
        frames = {name: getattr(self, name) for name in FRAMES}
        for key, value in {"namespace": self.namespace, **frames, **self.topics}.items():
            if (value or key in FRAMES) and not NAME.fullmatch(value):
                raise ValueError(f"{key}: got '{value}', expected a ROS name")

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
    if (pace := given.get("pace", "auto")) not in get_args(Pace):
        expected = ", ".join(get_args(Pace))
        raise InputError(f"--stack {name}: pace: got '{pace}', expected one of {expected}")
    topics = {key: given.pop(key) for key in TOPICS if key in given}
    given.setdefault("domain", os.environ.get("ROS_DOMAIN_ID") or "0")
    given["namespace"] = given.get("namespace", "").strip("/")
    try:
        return msgspec.convert({**given, "topics": topics}, Options, strict=False)
    except ValueError as error:  # msgspec's, too
        raise InputError(f"--stack {name}: {error}") from None
