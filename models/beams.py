"""Ray sensors as data: patterns of beams, ranges, and the unsigned millimetres that they report.

Nothing here needs the simulator, so a log can be replayed without it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

NO_RETURN = np.uint16(65535)
"""A beam that met nothing within range: it clears space up to the sensor's range."""

DROPPED = np.uint16(0)
"""A beam without information: it neither clears nor occupies."""

MILLIMETRES = 1000.0


@dataclass(frozen=True)
class SensorConfig:
    """How beams are cast.

    Attributes:
        engine: `tile` casts a sweep tile by tile, on primitives only; `mujoco` takes MuJoCo's own
            caster, which knows meshes and height fields too and is some ten times slower.
    """

    engine: Literal["tile", "mujoco"] = "tile"


@dataclass(frozen=True)
class Lidar:
    """A spinning lidar: every ring fires at every azimuth; one sweep is one instant here.

    Attributes:
        name: Topic name, unique on the robot.
        site: MJCF site that the beams leave from; x forward, z up.
        rings: Number of elevations.
        azimuths: Number of directions around the z axis.
        elevation_low: Lowest ring, rad.
        elevation_high: Highest ring, rad.
        range: Longest measured distance, m.
        rate: Sweeps a second, Hz.
        source: Where the figures come from.
    """

    name: str
    site: str
    rings: int
    azimuths: int
    elevation_low: float
    elevation_high: float
    range: float
    rate: float
    source: str

    def beam_tables(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return (rows, columns): (rings, 2) cos/sin of elevation, (azimuths, 2) of azimuth."""
        elevation = np.linspace(
            self.elevation_low, self.elevation_high, self.rings, dtype=np.float64
        )
        azimuth = np.arange(self.azimuths) * (2.0 * np.pi / self.azimuths) - np.pi
        return _cos_sin(elevation), _cos_sin(azimuth)


@dataclass(frozen=True)
class DepthCamera:
    """A pinhole depth camera that reports the range along each pixel's ray.

    Attributes:
        name: Topic name, unique on the robot.
        site: MJCF site of the optical centre; x along the axis, z up.
        height: Rows of pixels.
        width: Columns of pixels.
        field_of_view_horizontal: Full angle, rad.
        field_of_view_vertical: Full angle, rad.
        range: Longest measured distance, m.
        rate: Images a second, Hz.
        source: Where the figures come from.
    """

    name: str
    site: str
    height: int
    width: int
    field_of_view_horizontal: float
    field_of_view_vertical: float
    range: float
    rate: float
    source: str

    def beam_tables(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return (rows, columns): the slopes z/x of each row and y/x of each column, (n, 1)."""
        rows = np.tan(self.field_of_view_vertical / 2) * _pixel_centres(self.height)
        columns = np.tan(self.field_of_view_horizontal / 2) * _pixel_centres(self.width)
        return rows[:, None], columns[:, None]


@dataclass(frozen=True)
class Rangefinder:
    """A single beam by MuJoCo's own `<rangefinder>` sensor.

    Attributes:
        name: Topic name and name of the MJCF sensor.
        range: Longest measured distance, m.
        rate: Readings a second, Hz.
        source: Where the figures come from.
    """

    name: str
    range: float
    rate: float
    source: str

    def beam_tables(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return tables of the one beam, along the site's z axis as MuJoCo defines it."""
        return np.array([[0.0, 1.0]]), np.array([[1.0, 0.0]])


SweepSensor = Lidar | DepthCamera


def _cos_sin(angle: NDArray[np.floating]) -> NDArray[np.float64]:
    return np.stack([np.cos(angle), np.sin(angle)], axis=1, dtype=np.float64)


def _pixel_centres(count: int) -> NDArray[np.float64]:
    """Pixel centres over [1, -1]: the first row is the top one, the first column the left one."""
    return 1.0 - (2.0 * np.arange(count) + 1.0) / count


def beam_directions(
    rows: NDArray[np.float64], columns: NDArray[np.float64]
) -> NDArray[np.float64]:  # (rows * columns, 3)
    """Unit beam directions in the sensor frame (x forward, y left, z up), row-major.

    Only products, sums and square roots, which IEEE 754 rounds alike everywhere: directions
    rebuilt from logged tables are the same bits on every machine.

    Args:
        rows: (r, 2) cos and sin of elevation, or (r, 1) slopes z/x.
        columns: (c, 2) cos and sin of azimuth, or (c, 1) slopes y/x.
    """
    shape = (len(rows), len(columns))
    if rows.shape[1] == 2:
        x = rows[:, :1] * columns[None, :, 0]
        y = rows[:, :1] * columns[None, :, 1]
        z = np.broadcast_to(rows[:, 1:], shape)
    else:
        norm = np.sqrt(1.0 + rows**2 + columns.T**2)
        x, y, z = 1.0 / norm, columns.T / norm, rows / norm
    return np.stack([x, y, z], axis=-1).reshape(-1, 3)


def quantise(distance: NDArray[np.float64], range_limit: float) -> NDArray[np.uint16]:
    """Ranges in unsigned millimetres; misses (negative) and what lies beyond range: NO_RETURN."""
    millimetres = np.rint(distance * MILLIMETRES)
    beyond = (distance < 0.0) | (distance > range_limit)
    return np.where(beyond, NO_RETURN, np.clip(millimetres, 1, NO_RETURN - 1)).astype(np.uint16)


def rotate(
    R_world_sensor: NDArray[np.float64], directions: NDArray[np.float64]
) -> NDArray[np.float64]:  # (n, 3)
    """Beam directions in the world frame, element by element.

    Not a matrix product: BLAS may fuse or reorder, and a replay must give the same bits anywhere.

    Args:
        R_world_sensor: (3, 3).
        directions: (n, 3), sensor frame.
    """
    x, y, z = directions[:, :1], directions[:, 1:2], directions[:, 2:]
    return x * R_world_sensor[:, 0] + y * R_world_sensor[:, 1] + z * R_world_sensor[:, 2]
