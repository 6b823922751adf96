"""The geometry of a bounded grid of cubic cells: where each lies, which one a point is in."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

FLOOR_HEIGHT_IN_CELL = 0.75
"""Where the plane z = 0 lies in its layer of cells, from the layer's bottom, in cells.

On a face, a millimetre of noise would throw the floor's returns into either of two layers. High in
the cell rather than in its middle, a grazing beam is in the floor's layer for a short stretch only.
"""

MAX_CELLS = 200_000_000
MAX_COORDINATE = 1e6  # m
ROUNDING = 1e-6  # of a cell: an extent of 0.3 m holds three cells of 0.1 m


@dataclass(frozen=True)
class Grid:
    """A bounded grid of cubic cells, aligned with the world's axes.

    Attributes:
        resolution: Edge of a cell, m.
        origin: (3,) corner of the first cell, m, world.
        shape: (nx, ny, nz) cells.
        floor_layer: Index along z of the layer that holds the plane z = 0; may lie outside.
    """

    resolution: float
    origin: NDArray[np.float64]
    shape: tuple[int, int, int]
    floor_layer: int

    @classmethod
    def covering(cls, low: ArrayLike, high: ArrayLike, resolution: float) -> Self:
        """Cover a box: cells start at `low` in x and y; in z the floor decides.

        Args:
            low: (3,) least corner, m, world.
            high: (3,) greatest corner, m, world.
            resolution: Edge of a cell, m.

        Raises:
            ValueError: The box is empty or not finite, or would hold too many cells.
        """
        origin, top = finite_vector("low", low), finite_vector("high", high)
        if not np.all(origin < top):
            raise ValueError(f"bounds: got low {origin} and high {top}, expected low < high")
        layers_below = np.floor(origin[2] / resolution + FLOOR_HEIGHT_IN_CELL + ROUNDING)
        origin[2] = (layers_below - FLOOR_HEIGHT_IN_CELL) * resolution
        shape = grid_shape(origin, top, resolution)
        cells = shape[0] * shape[1] * shape[2]
        if cells > MAX_CELLS:
            raise ValueError(f"bounds: got {cells} cells {shape}, expected at most {MAX_CELLS}")
        return cls(resolution, origin, shape, -int(layers_below))

    def header(self) -> bytes:
        """The geometry as bytes, the same on every machine."""
        return struct.pack("<d3d3q", self.resolution, *self.origin, *self.shape)

    def indices(self, points: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Cells of points (n, 3), m, world: their indices (n, 3), and whether inside (n,)."""
        cells = np.floor((np.asarray(points, np.float64) - self.origin) / self.resolution)
        inside = np.all((cells >= 0) & (cells < self.shape), axis=1)  # false for NaN
        return np.where(inside[:, None], cells, 0).astype(np.int64), inside

    def box(self, low: ArrayLike, high: ArrayLike) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Cells whose centres lie in a box: the first (3,) and one past the last (3,), clipped."""
        least, greatest = finite_vector("low", low), finite_vector("high", high)
        first = np.ceil((least - self.origin) / self.resolution - 0.5)
        last = np.floor((greatest - self.origin) / self.resolution - 0.5)
        first = np.clip(first, 0, self.shape)
        end = np.clip(last + 1, first, self.shape)
        return first.astype(np.int64), end.astype(np.int64)

    def centres(
        self, first: NDArray[np.int64], end: NDArray[np.int64]
    ) -> list[NDArray[np.float64]]:
        """Centres of a box of cells along each axis, m, world: [(kx,), (ky,), (kz,)]."""
        return [
            self.origin[axis] + (np.arange(first[axis], end[axis]) + 0.5) * self.resolution
            for axis in range(3)
        ]


def grid_shape(low: ArrayLike, high: ArrayLike, resolution: float) -> tuple[int, int, int]:
    """Number of cells (nx, ny, nz) that cover a box from its least corner, m."""
    extent = (np.asarray(high, np.float64) - np.asarray(low, np.float64)) / resolution
    nx, ny, nz = (int(n) for n in np.ceil(extent - ROUNDING))
    return nx, ny, nz


def finite_vector(name: str, value: ArrayLike) -> NDArray[np.float64]:
    """A fresh (3,) float64 copy of a position.

    Raises:
        ValueError: It has another shape, or is not finite and within 1000 km.
    """
    vector = np.array(value, np.float64) + 0.0  # no negative zero: it would change the version
    if vector.shape != (3,) or not np.all(np.abs(vector) <= MAX_COORDINATE):
        raise ValueError(f"{name}: got {value!r}, expected 3 finite coordinates within 1e6 m")
    return vector
