"""The task of the navigation stack; in the log, so that replay needs no world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import msgspec

from wayproof.harness.errors import InputError

MIN_SIZE = 1e-6
"""Minimum of a size or a limit: below it no trajectory can be computed."""


@dataclass(frozen=True)
class Mission:
    """Body, operating area, start and goal; metres, radians and seconds in the world frame.

    Attributes:
        motion: `ground` walks or drives, `air` flies.
        radius: Circumscribed radius of the body, m.
        height: Top of the body above the ground (ground) or its vertical extent (air), m.
        step_height: Highest thing that the body steps over, m.
        max_speed: m/s.
        max_acceleration: m/s^2.
        max_jerk: m/s^3.
        max_yaw_rate: rad/s.
        low: Low corner of the geofence, m.
        high: High corner, m.
        start: Base origin at the start, m.
        start_heading: rad.
        goal: Base origin at the goal, m.
        discs: Offset along the body's x axis and radius of each disc of an elongated body, m;
            none for a body that is one disc or ball of the radius.
        sideways_speed: Speed in any direction, whatever the body faces, m/s; 0 for one that turns
            before it moves, or that flies and takes a bend no faster than it turns.
        waypoints: Goals before the last one, in their order, m; at each the robot comes to rest.
        max_yaw_acceleration: Change of the yaw rate while it moves, rad/s^2; 0 for no limit.
        rest_height: Height of the base origin above the ground when standing, m: where the feet of
            one that climbs are; 0 for all others.
    """

    motion: Literal["ground", "air"]
    radius: float
    height: float
    step_height: float
    max_speed: float
    max_acceleration: float
    max_jerk: float
    max_yaw_rate: float
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    start: tuple[float, float, float]
    start_heading: float
    goal: tuple[float, float, float]
    discs: tuple[tuple[float, float], ...] = ()
    waypoints: tuple[tuple[float, float, float], ...] = ()
    rest_height: float = 0.0
    sideways_speed: float = 0.0
    max_yaw_acceleration: float = 0.0

    def __post_init__(self) -> None:
        """Refuse bodies and areas that no robot has, before a map of that size is allocated."""
        for name in ("radius", "height", "max_speed", "max_acceleration", "max_jerk"):
            if not MIN_SIZE <= getattr(self, name) <= 1e4:
                raise ValueError(
                    f"{name}: got {getattr(self, name):g}, expected {MIN_SIZE:g} to 1e4"
                )
        for offset, radius in self.discs:
            if not (abs(offset) <= 1e4 and 0.0 < radius <= 1e4):
                raise ValueError(f"discs: got offset {offset:g} m and radius {radius:g} m")
        if self.discs and not self.planar:
            raise ValueError("discs: expected none for a body that flies")
        if not 0.0 < self.max_yaw_rate <= 100.0 or not 0.0 <= self.step_height <= self.height:
            raise ValueError("max_yaw_rate, step_height: expected those of a robot")
        if not 0.0 <= self.rest_height <= 1e4:
            raise ValueError(f"rest_height: got {self.rest_height:g} m, expected 0 to 1e4")
        if not 0.0 <= self.sideways_speed <= self.max_speed:
            raise ValueError(
                f"sideways_speed: got {self.sideways_speed:g}, expected 0 to max_speed"
            )
        if not 0.0 <= self.max_yaw_acceleration <= 1e4:
            raise ValueError(
                f"max_yaw_acceleration: got {self.max_yaw_acceleration:g}, expected 0 to 1e4"
            )
        if not abs(self.start_heading) <= 100.0:
            raise ValueError(f"start_heading: got {self.start_heading:g} rad")
        if not all(-1e4 <= a < b <= 1e4 for a, b in zip(self.low, self.high, strict=True)):
            raise ValueError(f"low, high: got {self.low} and {self.high}, expected low below high")
        for name, point in (("start", self.start), *(("goal", goal) for goal in self.goals)):
            if not all(abs(value) <= 1e4 for value in point):
                raise ValueError(f"{name}: got {point}, expected within 1e4 m")

    @property
    def planar(self) -> bool:
        """Whether the body moves in the plane, where the stack plans for it."""
        return self.motion == "ground"

    @property
    def body_discs(self) -> tuple[tuple[float, float], ...]:
        """Offset and radius of each disc of the body, m; the one disc or ball of a round body."""
        return self.discs or ((0.0, self.radius),)

    @property
    def axes(self) -> int:
        """Number of axes of a position that count: x and y in the plane, else x, y and z."""
        return 2 if self.planar else 3

    @property
    def goals(self) -> tuple[tuple[float, float, float], ...]:
        """All goals in their order, m; the last one is `goal`."""
        return (*self.waypoints, self.goal)

    def to_json(self) -> bytes:
        """Encode for the log; floats come back bit by bit. An empty or zero value has no field."""
        document = msgspec.to_builtins(self)
        for name in ("waypoints", "rest_height", "sideways_speed", "max_yaw_acceleration"):
            if not getattr(self, name):
                document.pop(name, None)  # nor has one that was decoded without it
        return msgspec.json.format(msgspec.json.encode(document), indent=1)

    @classmethod
    def from_json(cls, data: bytes) -> Mission:
        """Decode from a log.

        Raises:
            InputError: The text is no mission.
        """
        try:
            return msgspec.json.decode(data, type=cls)
        except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
            raise InputError(f"mission: {error}") from None
