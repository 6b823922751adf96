"""Free space of an imported scene on a grid: distances to obstacles, and slope of floors."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.models.arrays import Vector3
from wayproof.models.world_files.movers import around_start
from wayproof.models.world_files.options import Found
from wayproof.models.world_files.parts import Part
from wayproof.models.world_files.solids import solid_of
from wayproof.models.worlds.solids import Band, HeightField, Solid

LEAST_CELL = 0.05
"""Least side of a cell, m."""

MAX_CELLS = 300_000
"""Number of cells; of a larger scene they are larger."""

END_BAND = (0.03, 1.6)
"""Height band that is clear above chosen ends, m: of the built-in quadruped and the drone."""

MAX_WALK_SLOPE = 0.35
"""Steepest ground on the way between chosen ends, rad."""


class Ground:
    """Heights of an imported scene's floor."""

    def __init__(self, parts: Sequence[Part]) -> None:
        """Take the height fields among the parts of kind `floor`."""
        solids = [solid_of(part) for part in parts if part.kind == "floor"]
        self.floors = solids
        self.fields = [solid for solid in solids if isinstance(solid, HeightField)]

    def height(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the floor's height (n,) at points (n, 2), m; 0 beside every height field."""
        heights = np.full(len(points), -np.inf)
        for field in self.fields:
            np.maximum(heights, field.surface(points), out=heights)
        return np.where(np.isfinite(heights), heights, 0.0)


class Grid:
    """Cells over the operating area, and the free ones among them."""

    def __init__(self, low: Vector3, high: Vector3) -> None:
        """Divide the area between two corners into at most `MAX_CELLS` cells."""
        extent = np.subtract(high[:2], low[:2])
        self.cell = max(LEAST_CELL, sqrt(float(np.prod(extent)) / MAX_CELLS))
        self.low = np.array(low[:2])
        self.shape = tuple(max(round(float(n) / self.cell), 1) for n in extent)

    def centres(self, i: NDArray[np.int64], j: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the centres (n, 2) of cells, m."""
        return np.asarray(self.low + (np.column_stack([i, j]) + 0.5) * self.cell)

    def distances(
        self, solids: Sequence[Solid], ground: NDArray[np.float64], band: Band, reach: float
    ) -> NDArray[np.float64]:  # (nx, ny)
        """Return distances to obstacles in a band above the ground, up to a reach, m."""
        gaps = np.full(self.shape, reach)
        end = self.low + np.array(self.shape) * self.cell
        for solid in solids:
            # Clipped first: what is far beyond all numbers of cells divides to no number.
            low_corner = np.clip(np.array(solid.low[:2]) - reach, self.low, end) - self.low
            high_corner = np.clip(np.array(solid.high[:2]) + reach, self.low, end) - self.low
            first, last = np.floor(low_corner / self.cell), np.ceil(high_corner / self.cell)
            (i0, j0), (i1, j1) = (n.astype(int).clip(0, self.shape) for n in (first, last))
            under = ground[i0:i1, j0:j1]
            if not under.size:
                continue
            low, high = float(under.min()) + band[0], float(under.max()) + band[1]
            if solid.bottom >= high or solid.top <= low:
                continue
            window = gaps[i0:i1, j0:j1]
            i, j = np.nonzero(window > 0.0)
            there = solid.distance_in_plane(self.centres(i + i0, j + j0), (low, high))
            window[i, j] = np.minimum(window[i, j], there)
        return gaps


def slope_of(grid: Grid, heights: NDArray[np.float64]) -> NDArray[np.float64]:  # (nx, ny)
    """Return the steepest slope of the floor near each cell, rad."""
    from scipy import ndimage

    if min(heights.shape) < 2 or not np.ptp(heights):
        return np.zeros(heights.shape)
    slopes = np.arctan(np.hypot(*np.gradient(heights, grid.cell)))
    size = max(ceil(0.5 / grid.cell), 1)
    return np.asarray(ndimage.maximum_filter(slopes, size=2 * size + 1))


def to_edges(
    found: Found, ground: Ground, grid: Grid, reach: float
) -> NDArray[np.float64]:  # (nx, ny)
    """Return distances to where no floor is, and to the border of the area, up to a reach, m."""
    from scipy import ndimage

    borne = np.ones(grid.shape, np.bool_)
    if ground.floors and not found.plane:
        borne[:] = False
        for floor in ground.floors:
            first = np.floor((np.array(floor.low[:2]) - grid.low) / grid.cell).astype(int)
            last = np.ceil((np.array(floor.high[:2]) - grid.low) / grid.cell).astype(int)
            (i0, j0), (i1, j1) = (n.clip(0, grid.shape) for n in (first, last))
            if isinstance(floor, HeightField):
                borne[i0:i1, j0:j1] = True
                continue
            i, j = np.nonzero(~borne[i0:i1, j0:j1])
            if len(i):
                band = (floor.bottom - 1.0, floor.top + 1.0)
                there = floor.distance_in_plane(grid.centres(i + i0, j + j0), band)
                borne[i + i0, j + j0] = there <= 0.0
    framed = np.pad(borne, 1)
    far = ndimage.distance_transform_edt(framed, sampling=grid.cell)[1:-1, 1:-1] - grid.cell / 2.0
    return np.asarray(np.minimum(far, reach))


class Survey(NamedTuple):
    """A scene seen from above.

    Attributes:
        grid: Its cells.
        heights: (nx, ny) of the floor, m.
        gaps: (nx, ny) distance to what stands in a band above the floor, to a mover where it
            begins, or to an edge, m.
    """

    grid: Grid
    heights: NDArray[np.float64]
    gaps: NDArray[np.float64]


def survey(found: Found, low: Vector3, high: Vector3, band: Band, reach: float) -> Survey:
    """Return what stands in a band above the floor of an area, m.

    Args:
        found: Scene with its floor at 0, or terrain.
        low: Lower corner of the area, m.
        high: Upper corner, m.
        band: Heights above the floor, m.
        reach: Distance beyond which gaps are not measured, m.
    """
    grid, ground = Grid(low, high), Ground(found.parts)
    i, j = np.indices(grid.shape).reshape(2, -1)
    heights = ground.height(grid.centres(i, j)).reshape(grid.shape)
    standing = [solid_of(part) for part in found.parts if part.kind != "floor"]
    gaps = grid.distances([*standing, *map(around_start, found.movers)], heights, band, reach)
    return Survey(grid, heights, np.minimum(gaps, to_edges(found, ground, grid, reach)))
