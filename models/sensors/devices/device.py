"""Range sensors as data sheets have them: their errors, their mount, and the settings of both."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar, Literal

from wayproof.models.sensors.beams import LONGEST_RANGE, MILLIMETRES, BeamTable, Measures


@dataclass(frozen=True)
class RangeNoise:
    """Errors of a range sensor, independent from beam to beam; all zero is an ideal sensor.

    The standard deviation at a distance d is the root of the sum of the squares of `sigma`,
    `sigma_proportional` d and `sigma_quadratic` d^2: a constant and a proportional part as data
    sheets of lidars state them, and the quadratic one of triangulation (Khoshelham and Elberink,
    "Accuracy and resolution of Kinect depth data for indoor mapping applications", Sensors 2012).

    Attributes:
        sigma: Constant part of the standard deviation, m.
        sigma_proportional: Standard deviation per distance.
        sigma_quadratic: Standard deviation per squared distance, 1/m; a stereo camera's is the
            disparity's error in pixels over focal length in pixels and baseline in m.
        quantum: Reporting step, m; 0 is the log's millimetre.
        dropout: Probability that a return is lost.
        grazing: A return is lost if its beam meets the surface at a smaller angle than this, rad.
    """

    sigma: float = 0.0
    sigma_proportional: float = 0.0
    sigma_quadratic: float = 0.0
    quantum: float = 0.0
    dropout: float = 0.0
    grazing: float = 0.0

    def __post_init__(self) -> None:
        """Refuse errors that no sensor has.

        Raises:
            ValueError: A field is out of bounds; the message names it.
        """
        for name in ("sigma", "sigma_proportional", "sigma_quadratic"):
            value = getattr(self, name)
            if not 0.0 <= value < math.inf:
                raise ValueError(f"{name}: got {value:g}, expected a finite number >= 0")
        if self.quantum != 0.0 and not 1.0 / MILLIMETRES <= self.quantum < math.inf:
            raise ValueError(f"quantum: got {self.quantum:g}, expected 0 or at least 0.001 m")
        if not 0.0 <= self.dropout <= 1.0:
            raise ValueError(f"dropout: got {self.dropout:g}, expected a probability, 0 to 1")
        if not 0.0 <= self.grazing < math.pi / 2:
            raise ValueError(f"grazing: got {self.grazing:g}, expected 0 to less than pi/2 rad")


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


OWN = "own"
"""Name for the device that the robot's spec mounts."""


@dataclass(frozen=True)
class SensorConfig:
    """Devices that a robot carries, and how their sweeps are simulated.

    Attributes:
        lidar: Name in `DEVICES` of the device mounted as `lidar`; `own` is the robot's own.
        depth: Name in `DEVICES` of the device mounted as `depth`; `own` is the robot's own.
        engine: `tile` is Wayproof's caster; `mujoco` takes MuJoCo's own, which is slower, to check
            an episode against it.
        semantics: Whether a sweep reports the class of the geom that each beam met, without
            errors, as a labelled camera would.
    """

    lidar: str = OWN
    depth: str = OWN
    engine: Literal["tile", "mujoco"] = "tile"
    semantics: bool = False
