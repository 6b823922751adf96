"""Distances and prices of cells as kernels read them, and points in exact fractions of cells."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.kernel_compiler import kernel

SUBCELL_BITS = 16
SUBCELLS = 1 << SUBCELL_BITS
"""Sub-cells to a cell, along each axis."""

FARTHEST_CELL = 1 << 14
"""Largest distance from the origin, cells: beyond it products of crossing times could overflow."""

OUTSIDE = -1
"""Squared distance beyond the grid, below every threshold."""

Floats = NDArray[np.float64]
Point = tuple[float, float, float]
Pose = tuple[float, float, float, float]
"""Position x, y, z, m, and heading, rad."""

SubcellPoint = tuple[int, int, int]
Cell = tuple[int, int, int]


class Grid(NamedTuple):
    """A distance field, its place in the world, and the cost of its cells."""

    field: NDArray[np.uint16]  # (nx, ny, nz) squared cell distances
    price: NDArray[np.uint8]  # (nx, ny, nz) index of a cell's price; 0: its cost is by distance
    origin: Floats  # (3,) low corner, m
    resolution: float  # m
    cost_by_distance: Floats  # (t,) cost of a cell by its squared distance
    cost_by_price: Floats  # (p,) cost of a cell by its price; the first is of none


class Discs(NamedTuple):
    """The discs or balls of a body along its x axis."""

    offsets: Floats  # (m,) of the centres, m
    thresholds: NDArray[np.int64]  # (m,) largest forbidden squared cell distance of each


@kernel
def inside_value(field: NDArray[np.uint16], i: int, j: int, k: int) -> int:
    """Return a cell's squared distance; unsigned indices skip the check for negatives."""
    return int(field[np.uint64(i), np.uint64(j), np.uint64(k)])


@kernel
def cost_of(grid: Grid, value: int, i: int, j: int, k: int) -> float:
    """Return the cost of a cell inside the grid with a squared distance."""
    price = grid.price[np.uint64(i), np.uint64(j), np.uint64(k)]
    if price > 0:
        return float(grid.cost_by_price[price])
    return float(grid.cost_by_distance[np.uint64(min(value, len(grid.cost_by_distance) - 1))])


@kernel
def squared_distance(grid: Grid, i: int, j: int, k: int) -> int:
    """Return the squared distance of a cell; `OUTSIDE` beyond the grid."""
    nx, ny, nz = grid.field.shape
    if i < 0 or j < 0 or k < 0 or i >= nx or j >= ny or k >= nz:
        return OUTSIDE
    return inside_value(grid.field, i, j, k)


@kernel
def to_subcells(grid: Grid, point: Point) -> tuple[bool, SubcellPoint]:
    """Round a point, m, down to sub-cells; the flag is false if it is too far away, or NaN."""
    x = (point[0] - grid.origin[0]) / grid.resolution
    y = (point[1] - grid.origin[1]) / grid.resolution
    z = (point[2] - grid.origin[2]) / grid.resolution
    if not (abs(x) < FARTHEST_CELL and abs(y) < FARTHEST_CELL and abs(z) < FARTHEST_CELL):
        return False, (0, 0, 0)
    return True, (
        math.floor(x * SUBCELLS),
        math.floor(y * SUBCELLS),
        math.floor(z * SUBCELLS),
    )
