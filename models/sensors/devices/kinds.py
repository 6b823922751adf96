"""Kinds of range sensors: depth cameras, rangefinders, spinning lidars and solid-state ones."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from wayproof.models.sensors.beams import BeamTable, Measures
from wayproof.models.sensors.devices.device import Device


@dataclass(frozen=True, kw_only=True)
class DepthCamera(Device):
    """A pinhole camera with a global shutter; x along its axis, the image's top row up.

    Attributes:
        height: Rows of pixels.
        width: Columns of pixels.
        field_of_view_horizontal: Full angle, rad.
        field_of_view_vertical: Full angle, rad.
    """

    kind: ClassVar[str] = "depth_camera"

    height: int
    width: int
    field_of_view_horizontal: float
    field_of_view_vertical: float
    measures: Measures = "depth"

    def beam_table(self) -> BeamTable:
        """Return slopes z/x of each row and y/x of each column, through the pixels' centres."""
        for name in ("field_of_view_horizontal", "field_of_view_vertical"):
            angle = getattr(self, name)
            if not 0.0 < angle < math.pi:
                raise ValueError(f"{name}: got {angle:g}, expected > 0 to less than pi rad")
        if min(self.height, self.width) < 1:
            raise ValueError(
                f"height, width: got {self.height} and {self.width}, expected each >= 1"
            )
        rows = np.tan(self.field_of_view_vertical / 2) * _pixel_centres(self.height)
        columns = np.tan(self.field_of_view_horizontal / 2) * _pixel_centres(self.width)
        return BeamTable(
            rows=rows[:, None],
            columns=columns[:, None],
            beams=self.height * self.width,
            measures=self.measures,
        )


def _pixel_centres(count: int) -> NDArray[np.float64]:
    """Return pixel centres over [1, -1], the top row and the left column first."""
    centres: NDArray[np.float64] = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    return centres


@dataclass(frozen=True, kw_only=True)
class Rangefinder(Device):
    """One beam by MuJoCo's own `<rangefinder>` sensor, which sees no geom of its own body."""

    kind: ClassVar[str] = "rangefinder"
    by_mujoco: ClassVar[bool] = True

    def beam_table(self) -> BeamTable:
        """Return the one beam, along the site's z axis as MuJoCo defines it."""
        return BeamTable(
            rows=np.array([[0.0, 1.0]]),
            columns=np.array([[1.0, 0.0]]),
            beams=1,
            measures=self.measures,
        )


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


@dataclass(frozen=True, kw_only=True)
class SolidStateLidar(Device):
    """A lidar that draws a zigzag that continues from sweep to sweep.

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
