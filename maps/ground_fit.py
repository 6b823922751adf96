"""Evidence of a flat floor in a sweep: the plane that its returns lie on, and its noise.

A sensor whose mounting is off by a degree sees the floor 17 cm too high or too low at 10 m, and
noise puts single returns above what a foot steps over: both are obstacles of the floor's own. As in
the ground segmentation of lidar odometry (Shan and Englot 2018, "LeGO-LOAM"), the floor is found
first, by its own returns, and what stands on it is judged from there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.kernels import ground_fit as kernels
from wayproof.maps.sweep import Ranges

LEAST_POINTS = 100
"""Fewest returns that hold a plane."""

MOST_POINTS = 8192
"""Beams that are looked at for a fit: of larger sweeps every second, third or fourth."""

LEAST_SPREAD = 0.25
"""Least standard deviation of their places on the floor along any axis, m: of an aisle of 0.9 m."""

LEVEL = math.radians(0.1)
"""Tilt up to which a floor is as expected, rad: 1.7 cm at 10 m."""

QUIET = 0.005
"""Deviation of its returns up to which a floor is as expected, m; and its height at the sensor."""

TILE = 0.25
"""Edge of the tiles of floor that are judged together, m."""

TILES = 161
"""Tiles along an axis, the sensor in the middle one: 20 m to each side."""

SUSPECT = 0.02
"""Deviation from which a fit may have settled on the feet of walls, m; 3 cm of noise give 0.014."""

RESIDUAL = 0.01
"""Deviation of a floor's height from a plane that is no error of a range, m."""

LOWEST_OBSTACLE = 0.1
"""Height from which on a return is never the floor's, m, however noisy."""


@dataclass(frozen=True)
class GroundPlane:
    """A plane near z = 0 in one sweep.

    Attributes:
        numbers: (5,) height at the anchor, m; slopes along x and y, m/m; anchor x and y, m.
        deviation: Root mean square distance of the returns below it, m; nothing but errors puts a
            floor's return there.
        range_deviation: That of errors of the ranges that give such distances, m.
        points: Number of returns that it was fitted to.
    """

    numbers: NDArray[np.float64]
    deviation: float
    range_deviation: float
    points: int

    @property
    def as_expected(self) -> bool:
        """Whether it is z = 0 up to a difference that changes no cell."""
        height, along_x, along_y = self.numbers[:3].tolist()
        flat = along_x * along_x + along_y * along_y <= LEVEL * LEVEL and abs(height) <= QUIET
        return flat and self.deviation <= QUIET


@dataclass(frozen=True)
class LevelSweep:
    """A sweep whose floor is z = 0.

    Attributes:
        origins: (m, 3) m, world.
        directions: (n, 3) unit vectors, world.
        ranges_mm: (n,) as `VoxelMap.integrate` takes them.
        on_floor: (n,) whether a return is the floor's.
    """

    origins: NDArray[np.float64]
    directions: NDArray[np.float64]
    ranges_mm: Ranges
    on_floor: NDArray[np.bool_]


def level(
    origins: NDArray[np.float64],
    moments: NDArray[np.int32],
    directions: NDArray[np.float64],
    ranges_mm: Ranges,
    plane: GroundPlane,
) -> LevelSweep:
    """Shear a sweep so that a plane is z = 0, and put the floor's returns on it.

    A return up to six deviations below the floor is noise where those beside it are at z = 0.

    Args:
        origins: (m, 3) where beams start, m, world.
        moments: (n,) origin of each beam.
        directions: (n, 3) unit vectors, world.
        ranges_mm: (n,) mm.
        plane: Plane of the floor.
    """
    level_origins, ends = np.empty_like(origins), np.empty_like(directions)
    kernels.tilt_back(origins, moments, directions, ranges_mm, plane.numbers, level_origins, ends)
    on_floor = np.empty(len(ranges_mm), np.bool_)
    deviations = plane.range_deviation, RESIDUAL, LOWEST_OBSTACLE
    tiling = TILE, TILES
    kernels.put_on_floor(level_origins, moments, ranges_mm, deviations, tiling, ends, on_floor)
    level_directions, level_mm = np.empty_like(directions), np.empty_like(ranges_mm)
    kernels.beams_of(ends, ranges_mm, level_directions, level_mm)
    return LevelSweep(level_origins, level_directions, level_mm, on_floor)


def fit_ground(
    origins: NDArray[np.float64],
    moments: NDArray[np.int32],
    directions: NDArray[np.float64],
    ranges_mm: Ranges,
) -> GroundPlane | None:
    """Fit the plane of a floor to the returns of a sweep.

    A fit with a large deviation is compared with one from z = 0: a sensor that looks down little
    sees more of the feet of near walls than of the floor.

    Args:
        origins: (m, 3) where beams start, m, world; the floor is expected at z = 0.
        moments: (n,) origin of each beam.
        directions: (n, 3) unit vectors, world.
        ranges_mm: (n,) mm.

    Returns:
        The plane, z = 0 itself where the floor is as expected; None where too few returns hold it,
        or it is steeper than `kernels.TILT` or farther off than `kernels.HEIGHT`.
    """
    stride = max(1, len(ranges_mm) // MOST_POINTS)
    near = np.empty((len(ranges_mm) // stride + 1, 3))
    found = kernels.returns_near_floor(origins, moments, directions, ranges_mm, stride, near)
    near, sensor = near[:found], origins[-1]
    at_zero = kernels.count_at_zero(near, QUIET)
    if at_zero >= LEAST_POINTS:
        return GroundPlane(np.array([0.0, 0.0, 0.0, sensor[0], sensor[1]]), 0.0, 0.0, at_zero)
    plane = _fitted(near, sensor, kernels.BANDS, kernels.TILT)
    if plane is None or plane.deviation > SUSPECT:
        narrow = _fitted(near, sensor, kernels.NARROW_BANDS, 0.0)
        if narrow is not None and narrow.deviation <= SUSPECT:
            plane = narrow
    if plane is None:
        return None
    height, along_x, along_y = plane.numbers[:3].tolist()
    steep = along_x * along_x + along_y * along_y > kernels.TILT * kernels.TILT
    return None if steep or abs(height) > kernels.HEIGHT else plane


def _fitted(
    near: NDArray[np.float64], sensor: NDArray[np.float64], bands: NDArray[np.float64], tilt: float
) -> GroundPlane | None:
    """Return the plane of one fit; None where too few returns hold it."""
    numbers, figures = np.zeros(5), np.zeros(3)
    x, y, z = sensor.tolist()
    count = kernels.fit_plane(near, (x, y, z), bands, tilt, numbers, figures)
    deviation, spread, range_deviation = figures.tolist()
    if count < LEAST_POINTS or spread < LEAST_SPREAD:
        return None
    return GroundPlane(numbers, deviation, range_deviation, count)


def warm_up() -> None:
    """Compile the kernels of a sweep of 16 bits."""
    directions = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    beams = np.array([[0.0, 0.0, 0.5]]), np.zeros(2, np.int32), directions
    ranges_mm = np.array([500, 65535], np.uint16)
    fit_ground(*beams, ranges_mm)
    level(*beams, ranges_mm, GroundPlane(np.zeros(5), 0.0, 0.0, 1))
