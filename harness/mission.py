"""The task as the navigation stack is told it; in the log, so that replay needs no world."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import msgspec

from harness.errors import InputError


@dataclass(frozen=True)
class Mission:
    """Body, operating area, start and goal; metres, radians and seconds in the world frame.

    Attributes:
        motion: `ground` plans in the plane, `air` in space.
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

    def to_json(self) -> bytes:
        """Encode for the log; floats come back bit by bit."""
        return msgspec.json.format(msgspec.json.encode(self), indent=1)

    @classmethod
    def from_json(cls, data: bytes) -> Mission:
        """Decode from a log.

        Raises:
            InputError: The text is no mission.
        """
        try:
            return msgspec.json.decode(data, type=cls)
        except msgspec.DecodeError as error:
            raise InputError(f"mission: {error}") from None
