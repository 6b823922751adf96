"""Perturbation of stamps: a clock is ahead of the robot's by a constant time, or ever more."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from wayproof.harness.perturbations.perturbation import (
    MOST_LAG,
    Arrival,
    Changes,
    Lag,
    Perturbation,
)

POSE = "pose"


class ClockSkew(Perturbation, frozen=True, tag="clock_skew"):
    """Messages are older than their stamps say, by the amount rounded to whole messages.

    Attributes:
        stream: Sensor whose clock is off, or `pose`; all sensors if none is named.
        drift: Time by which it gains on the robot's in a second of simulated time, s, besides.
    """

    stream: str = ""
    drift: float = 0.0
    changes: ClassVar[Changes] = "arrivals"
    measured_in: ClassVar[str] = "s"
    values: ClassVar[tuple[float, float, float, float, float]] = (0.1, 0.2, 0.3, 0.5, 1.0)
    restamps: ClassVar[bool] = True

    def affected(self, sensors: Sequence[str]) -> tuple[str, ...]:
        """Return the sensors whose clocks are off: none if that of the pose is."""
        return () if self.stream == POSE else self.named(self.stream, sensors, POSE)

    @property
    def delays_pose(self) -> bool:
        """Whether the pose's clock is off."""
        return self.stream == POSE

    def lag(self, arrival: Arrival) -> Lag:
        """Return the number of messages by which they come later than their stamps say."""
        late_ns = self.amount * 1e9 + self.drift * arrival.time_ns
        return min(max(round(late_ns / arrival.period_ns), 0), MOST_LAG)
