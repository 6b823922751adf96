"""Base class of range sensors, and the mount of one on a robot."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar

from wayproof.models.sensors.beams import LONGEST_RANGE, BeamTable, Measures
from wayproof.models.sensors.devices.noise import RangeNoise


@dataclass(frozen=True, kw_only=True)
class Device(ABC):
    """A range sensor as its data sheet describes it, on no robot in particular.

    A kind of sensor is a subclass: it names itself in `kind` and gives its beams in `beam_table`.
    Rays, errors, the log and replay need no more of it.

    Attributes:
        range: Longest measured distance, m, at most what a log holds: 65.534.
        minimum_range: Distance below which a surface gives no information, m.
        rate: Sweeps, images or readings per second, Hz.
        noise: Errors of its ranges.
        no_return_is_free: Whether a beam without echo is evidence of free space up to the range. A
            real sensor cannot tell black or slanted surfaces from emptiness.
        measures: `range` along the beam, or `depth` along the sensor's x axis; range,
            minimum_range and noise are in terms of it.
        source: Data sheet or assumption that the figures come from.
    """

    kind: ClassVar[str]
    """Name of the kind in a log, such as `lidar`."""

    by_mujoco: ClassVar[bool] = False
    """Whether MuJoCo's own `<rangefinder>` measures, which sees all geoms but its own body's."""

    range: float
    minimum_range: float = 0.0
    rate: float
    noise: RangeNoise = field(default_factory=RangeNoise)
    no_return_is_free: bool
    measures: Measures = "range"
    source: str

    def __post_init__(self) -> None:
        """Refuse figures that no sensor has.

        Raises:
            ValueError: A field is out of bounds; the message names it.
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
            raise ValueError("source: got nothing, expected a data sheet or an assumption")
        self.beam_table()  # which checks the pattern

    @abstractmethod
    def beam_table(self) -> BeamTable:
        """Return the pattern of its beams.

        Raises:
            ValueError: The figures give no pattern.
        """


@dataclass(frozen=True)
class Mount:
    """A device on a robot.

    Attributes:
        name: Topic name, unique on the robot; a rangefinder's is its MJCF sensor's name.
        site: MJCF site that the beams leave from; x forward, z up. A rangefinder looks along z.
        device: The device mounted there.
    """

    name: str
    site: str
    device: Device

    def __post_init__(self) -> None:
        """Refuse a mount without name or site."""
        for name in ("name", "site"):
            if not getattr(self, name):
                raise ValueError(f"{name}: got nothing, expected a name")
