"""A kind of sensor that Wayproof does not have: a ring of sonars, all in one file."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from wayproof.models.sensors.beams import BeamTable
from wayproof.models.sensors.devices import Device, RangeNoise


@dataclass(frozen=True, kw_only=True)
class SonarRing(Device):
    """Sonars in a ring, each with a fan of beams over its cone, fired one after another.

    Attributes:
        sonars: Number of sonars around the z axis.
        cone: Full opening angle of each, rad.
        rays: Number of beams over each cone.
    """

    kind: ClassVar[str] = "sonar_ring"

    sonars: int
    cone: float
    rays: int

    def beam_table(self) -> BeamTable:
        """Return one row, with the beams of every sonar side by side."""
        centres = np.arange(self.sonars) * (2.0 * np.pi / self.sonars)
        fan = np.linspace(-0.5 * self.cone, 0.5 * self.cone, self.rays)
        azimuth = (centres[:, None] + fan).ravel()
        return BeamTable(
            rows=np.array([[1.0, 0.0]]),
            columns=np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1),
            beams=len(azimuth),
            scan_poses=self.sonars,
            measures=self.measures,
        )


SONAR_RING = SonarRing(
    sonars=16,
    cone=0.26,
    rays=5,
    range=5.0,
    minimum_range=0.15,
    rate=10.0,
    noise=RangeNoise(sigma_proportional=0.01),
    no_return_is_free=True,
    source="assumed: sixteen sonars as robots of the nineties carried them",
)
