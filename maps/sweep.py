"""A sweep of beams: its arguments checked, and its statistics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from wayproof.maps.grid import MAX_COORDINATE
from wayproof.maps.kernels import beams

Ranges = NDArray[np.uint16] | NDArray[np.uint32]
"""Ranges, mm; of 32 bits where one is longer than 65.534 m. 65535 is no return in both."""


Spared = Literal["floor", "own", "none"]
"""Layer of cells that a beam from above which ends in it does not clear: the floor's, whichever the
beam ends in, or none. At grazing angles it would take away the surface that it is about to hit."""

NO_RETURN_MM = 65535
"""Range of a beam without return, mm."""

LONGEST_MM = 2**32 - 1
"""Longest range, mm."""


@dataclass(frozen=True)
class SweepStatistics:
    """Beams of a sweep by fate.

    Attributes:
        hits: Beams that hit a surface.
        clears: Beams without a return within the range limit; they only clear.
        dropped: Beams without information.
        too_near: Beams below the minimum range; ignored.
        cells_updated: Cells whose evidence this sweep touched.
    """

    hits: int
    clears: int
    dropped: int
    too_near: int
    cells_updated: int


@dataclass(frozen=True)
class Sweep:
    """Beams as the kernels take them.

    Attributes:
        origins: (m, 3) where beams start, m, world.
        sensors: (m, 3) sub-cells that beams start in.
        moments: (n,) origin of each beam, ascending; (0,) if all start at the first.
        directions: (n, 3) unit vectors, world.
        ranges_mm: (n,) uint16 or uint32 measured ranges, mm; 65535 is no return in both.
        limits_mm: Nearest return that counts, and range up to which no return clears.
        resolution: Edge of a cell, m.
    """

    origins: NDArray[np.float64]
    sensors: NDArray[np.int64]
    moments: NDArray[np.int32]
    directions: NDArray[np.float64]
    ranges_mm: Ranges
    limits_mm: tuple[int, int]
    resolution: float

    @property
    def sources(self) -> NDArray[np.int32]:
        """(n,) index of each beam's origin."""
        if len(self.moments) == 0:
            return np.zeros(len(self.ranges_mm), np.int32)
        return self.moments

    @property
    def groups(self) -> NDArray[np.int64]:
        """(m + 1,) first beam of each origin, and the end."""
        if len(self.moments) == 0:
            return np.array([0, len(self.ranges_mm)])
        return np.searchsorted(self.moments, np.arange(len(self.origins) + 1))


def check_time(time_ns: int) -> None:
    """Refuse a time before the start.

    Raises:
        ValueError: The time is negative.
    """
    if time_ns < 0:
        raise ValueError(f"time_ns: got {time_ns}, expected 0 or more")


def beams_from_points(
    origin: ArrayLike, points: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.uint32]]:
    """Return the beams from a sensor to the points that it returned, as `integrate` takes them.

    Args:
        origin: (3,) the sensor, m, world.
        points: (n, 3) returns, m, world. One that is not finite is a dropped beam.

    Returns:
        (n, 3) unit vectors, world, and (n,) ranges, mm; 65.535 m, the code of no return, becomes
        65.534 m.

    Raises:
        ValueError: Other shapes, an origin that is not finite, or a point farther than 4294 km.
    """
    start, ends = np.asarray(origin, np.float64), np.asarray(points, np.float64)
    if start.shape != (3,) or ends.ndim != 2 or ends.shape[1] != 3:
        raise ValueError(f"points: got {start.shape} and {ends.shape}, expected (3,) and (n, 3)")
    if not np.isfinite(start).all():
        raise ValueError(f"origin: got {start.tolist()}, expected finite coordinates")
    finite = np.isfinite(ends[:, 0]) & np.isfinite(ends[:, 1]) & np.isfinite(ends[:, 2])
    away = np.where(finite[:, None], ends, start) - start
    ranges = np.sqrt(away[:, 0] * away[:, 0] + away[:, 1] * away[:, 1] + away[:, 2] * away[:, 2])
    ranges_mm = np.rint(ranges * 1000.0)
    if len(ranges_mm) and float(ranges_mm.max()) > LONGEST_MM:
        raise ValueError(f"points: got one {ranges.max():g} m away, expected at most 4294 km")
    seen = ranges > 0.0
    directions = np.zeros(away.shape)
    directions[~seen, 0] = 1.0
    directions[seen] = away[seen] / ranges[seen, None]
    ranges_mm[ranges_mm == NO_RETURN_MM] -= 1.0
    return directions, ranges_mm.astype(np.uint32)


def prepare_sweep(
    origins: ArrayLike,
    moments: NDArray[np.int32] | None,
    directions: NDArray[np.float64],
    ranges_mm: Ranges,
    range_limit: float,
    minimum_range: float,
    resolution: float,
) -> Sweep:
    """Check the arguments of a sweep, apart from the length of its directions.

    Raises:
        ValueError: Wrong shapes or types, an origin that is not finite and within 1000 km or too
            many of them, moments outside the origins, or a range limit that is not within 0 to
            2047 cells.
    """
    starts = np.array(origins, np.float64, ndmin=2)
    if starts.ndim != 2 or starts.shape[1] != 3:
        raise ValueError(f"origins: got shape {np.shape(origins)}, expected (3,) or (m, 3)")
    if len(starts) > beams.MAX_ORIGINS:
        raise ValueError(f"origins: got {len(starts)}, expected at most {beams.MAX_ORIGINS}")
    sensors = np.empty(starts.shape, np.int64)
    strange = beams.locate_sensors(starts, MAX_COORDINATE, beams.SUBCELLS / resolution, sensors)
    if strange >= 0:
        raise ValueError(
            f"origins: got {starts[strange].tolist()}, expected finite coordinates within 1e6 m"
        )
    if ranges_mm.dtype not in (np.uint16, np.uint32) or directions.shape != (*ranges_mm.shape, 3):
        raise ValueError(
            f"beams: got directions {directions.shape} and ranges {ranges_mm.dtype} "
            f"{ranges_mm.shape}, expected (n, 3) and uint16 or uint32 (n,)"
        )
    longest = beams.MAX_BEAM_CELLS * resolution
    if not 0.0 < range_limit <= longest:
        raise ValueError(f"range_limit: got {range_limit:g}, expected up to {longest:g} m")
    order: slice | NDArray[np.intp] = slice(None)
    if moments is None:
        if len(starts) != 1:
            raise ValueError(f"moments: got none for {len(starts)} origins, expected one each beam")
        moments = np.empty(0, np.int32)
    else:
        named = moments.dtype.kind in "iu" and moments.shape == ranges_mm.shape
        least, most = _range(moments) if named else (-1, -1)
        if not 0 <= least <= most < len(starts):
            raise ValueError(
                f"moments: got {moments.dtype} {moments.shape}, "
                f"expected whole numbers {ranges_mm.shape} in 0 to {len(starts) - 1}"
            )
        if least < most and (moments[1:] < moments[:-1]).any():
            order = np.argsort(moments, kind="stable")
    return Sweep(
        origins=starts,
        sensors=sensors,
        moments=_plain(moments[order] if len(moments) else moments, np.int32),
        directions=_plain(directions[order], np.float64),
        ranges_mm=_plain(ranges_mm[order], ranges_mm.dtype.type),
        limits_mm=(round(minimum_range * 1000), round(range_limit * 1000)),
        resolution=resolution,
    )


def _range(indices: NDArray[np.integer]) -> tuple[int, int]:
    """Return the least and greatest of some indices (n,); 0 if there are none."""
    return (int(indices.min()), int(indices.max())) if len(indices) else (0, 0)


def _plain(array: NDArray[Any], dtype: type[Any]) -> NDArray[Any]:
    """Copy an array that is read-only, as a log's is: to the compiler it is another type."""
    if array.dtype == dtype and array.flags.carray:
        return array
    return np.require(array, dtype, ["C", "W", "A"])
