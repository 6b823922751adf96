"""What every range sensor states about itself, and where a robot carries one."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field

from wayproof.models.sensors.beams import LONGEST_RANGE, BeamTable, Measures
from wayproof.models.sensors.devices.noise import RangeNoise


@dataclass(frozen=True, kw_only=True)
class Device(ABC):
    """A range sensor as its data sheet describes it, on no robot in particular.

    Attributes:
        range: Longest measured distance, m, at most what a log holds: 65.534.
        minimum_range: What is nearer gives no information, m.
        rate: Sweeps, images or readings a second, Hz.
        noise: Errors of its ranges.
        no_return_is_free: Whether a beam without echo is evidence of free space up to the range. A
            real sensor cannot tell black or slanted surfaces from emptiness.
        measures: `range` along the beam, or `depth` along the sensor's x axis; range,
            minimum_range and noise are in terms of it.
        source: Where the figures come from.
    """

    range: float
    minimum_range: float = 0.0
    rate: float
    noise: RangeNoise = field(default_factory=RangeNoise)
    no_return_is_free: bool
    measures: Measures = "range"
    source: str

    def __post_init__(self) -> None:
        """Refuse what no sensor is.

        Raises:
            ValueError: A field is outside its span; the message names it.
        """
        if not 0.0 < self.range <= LONGEST_RANGE:
            raise ValueError(f"range: got {self.range:g}, expected > 0 to {LONGEST_RANGE} m")
        if not 0.0 <= self.minimum_range < self.range:
            raise ValueError(
                f"minimum_range: got {self.minimum_range:g}, expected 0 to less than the range of "
                f"{self.range:g} m"
            )
        if not 0.0 < self.rate < math.inf:
            raise ValueError(f"rate: got {self.rate:g}, expected a finite number > 0 Hz")
        if not self.source:
            raise ValueError("source: got nothing, expected where the figures come from")
        self.beam_table()  # which checks the pattern

    @abstractmethod
    def beam_table(self) -> BeamTable:
        """The pattern of its beams.

        Raises:
            ValueError: It has none.
        """


@dataclass(frozen=True)
class Mount:
    """A device on a robot.

    Attributes:
        name: Topic name, unique on the robot; a rangefinder's is its MJCF sensor's name.
        site: MJCF site that the beams leave from; x forward, z up. A rangefinder looks along z.
        device: What is mounted there.
    """

    name: str
    site: str
    device: Device

    def __post_init__(self) -> None:
        """Refuse a mount without name or site."""
        for name in ("name", "site"):
            if not getattr(self, name):
                raise ValueError(f"{name}: got nothing, expected a name")
