"""Lidars with a non-repetitive pattern, whose coverage grows with time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from wayproof.models.sensors.beams import BeamTable
from wayproof.models.sensors.devices.device import Device
from wayproof.models.sensors.devices.spinning_lidar import cos_sin


@dataclass(frozen=True, kw_only=True)
class SolidStateLidar(Device):
    """A lidar that draws a zigzag which goes on from sweep to sweep.

    From beam to beam the elevation moves by `row_step` rows, up and down again, and the azimuth by
    `column_step` columns, see `models.sensors.beams.directions`. The pattern repeats after
    lcm(2 rows, columns) beams if the steps share no factor with 2 rows and columns: table lengths
    without a common factor make that long.

    Attributes:
        elevation_low: Lower edge of the field of view, rad.
        elevation_high: Upper edge, rad.
        azimuth_low: Right edge, rad.
        azimuth_high: Left edge, rad; the full circle by default.
        rows: Number of elevations.
        columns: Number of azimuths.
        row_step: Rows from one beam to the next.
        column_step: Columns from one beam to the next.
        beams: Beams in a sweep.
        scan_poses: Sensor poses in one sweep, each for as many successive beams; 1 freezes the
            motion of the body during a sweep.
    """

    kind: ClassVar[str] = "lidar"

    elevation_low: float
    elevation_high: float
    azimuth_low: float = -math.pi
    azimuth_high: float = math.pi
    rows: int
    columns: int
    row_step: int
    column_step: int
    beams: int
    scan_poses: int = 1

    def beam_table(self) -> BeamTable:
        """Return rows and columns at the centres of equal parts of the field of view."""
        if not -math.pi / 2 <= self.elevation_low < self.elevation_high <= math.pi / 2:
            raise ValueError(
                f"elevation_low, elevation_high: got {self.elevation_low:g} and "
                f"{self.elevation_high:g}, expected increasing angles within +-pi/2 rad"
            )
        if not 0.0 < self.azimuth_high - self.azimuth_low <= 2.0 * math.pi:
            raise ValueError(
                f"azimuth_low, azimuth_high: got {self.azimuth_low:g} and {self.azimuth_high:g}, "
                "expected increasing angles at most 2 pi rad apart"
            )
        if min(self.rows, self.columns) < 1:
            raise ValueError(
                f"rows, columns: got {self.rows} and {self.columns}, expected each >= 1"
            )
        return BeamTable(
            rows=_centres(self.elevation_low, self.elevation_high, self.rows),
            columns=_centres(self.azimuth_low, self.azimuth_high, self.columns),
            beams=self.beams,
            order="pairs",
            row_step=self.row_step,
            column_step=self.column_step,
            scan_poses=self.scan_poses,
            measures=self.measures,
        )


def _centres(low: float, high: float, parts: int) -> NDArray[np.float64]:  # (parts, 2)
    return cos_sin(low + (np.arange(parts) + 0.5) * ((high - low) / parts))
