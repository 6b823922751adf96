"""Errors of range sensors."""

from __future__ import annotations

import math
from dataclasses import dataclass

from wayproof.models.sensors.beams import MILLIMETRES


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
