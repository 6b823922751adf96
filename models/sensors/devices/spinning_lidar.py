"""Spinning lidars: every ring fires at every azimuth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from wayproof.models.sensors.beams import BeamTable
from wayproof.models.sensors.devices.device import Device


def evenly(low: float, high: float, rings: int) -> tuple[float, ...]:
    """Return the elevations of evenly spaced rings from `low` to `high`, both included, rad."""
    return tuple(np.linspace(low, high, rings, dtype=np.float64).tolist())


@dataclass(frozen=True, kw_only=True)
class SpinningLidar(Device):
    """A lidar that turns once a sweep about its z axis, counterclockwise from behind.

    Attributes:
        elevations: Elevation of each ring, rad; see `evenly`.
        azimuths: Number of directions around the z axis.
        scan_poses: Sensor poses in one sweep, each for as many neighbouring azimuths; 1 freezes the
            motion of the body during a sweep.
    """

    kind: ClassVar[str] = "lidar"

    elevations: tuple[float, ...]
    azimuths: int
    scan_poses: int = 1

    def beam_table(self) -> BeamTable:
        """Return one row for each ring and one column for each azimuth, in firing order."""
        if not self.elevations or self.azimuths < 1:
            raise ValueError(
                f"elevations, azimuths: got {len(self.elevations)} and {self.azimuths}, "
                "expected each >= 1"
            )
        azimuth = np.arange(self.azimuths) * (2.0 * np.pi / self.azimuths) - np.pi
        return BeamTable(
            rows=cos_sin(np.array(self.elevations)),
            columns=cos_sin(azimuth),
            beams=len(self.elevations) * self.azimuths,
            scan_poses=self.scan_poses,
            measures=self.measures,
        )


def cos_sin(angle: NDArray[np.floating]) -> NDArray[np.float64]:  # (n, 2)
    """Return cosine and sine of each angle (n,) in rad, as a beam table holds them."""
    return np.stack([np.cos(angle), np.sin(angle)], axis=1, dtype=np.float64)
