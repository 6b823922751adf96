"""Whole bricks around a box of cells: the window in which a sweep is rasterized."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.columns import Window
from wayproof.maps.kernels import bricks
from wayproof.maps.voxel.brick_index import BELOW, BITS

Cell = tuple[int, int, int]
"""Indices of a cell as plain numbers: an array of three takes ten times as long."""


class Frame(NamedTuple):
    """The whole bricks around a box of cells.

    Attributes:
        first: Index of the first brick.
        corner: Least cell.
        shape: (nx, ny, words).
    """

    first: Cell
    corner: Cell
    shape: Cell

    @classmethod
    def around(cls, low: Cell, high: Cell) -> Frame:
        """Return the frame of the cells from `low` to `high`, both included."""
        x0, y0, z0 = _brick(low)
        x1, y1, z1 = _brick(high)
        corner = x0 * bricks.EDGE, y0 * bricks.EDGE, z0 * bricks.HEIGHT - bricks.BELOW_FLOOR
        shape = (x1 - x0 + 1) * bricks.EDGE, (y1 - y0 + 1) * bricks.EDGE, z1 - z0 + 1
        return cls((x0, y0, z0), corner, shape)

    def box_within(self, box: tuple[Cell, Cell]) -> tuple[int, int, int, int, int, int]:
        """Return the least and the greatest cell of a box, counted from the corner."""
        x, y, z = self.corner
        (x0, y0, z0), (x1, y1, z1) = box
        return x0 - x, y0 - y, z0 - z, x1 - x, y1 - y, z1 - z


def cell_of(coordinates: Iterable[int]) -> Cell:
    """Return three indices as a cell."""
    x, y, z = coordinates
    return x, y, z


def clipped(cell: Iterable[int], bounds: NDArray[np.int64] | None) -> Cell:
    """Return the nearest cell within bounds (2, 3), least and greatest; None for no bounds."""
    if bounds is None:
        return cell_of(cell)
    low, high = bounds.tolist()
    return cell_of(min(max(c, a), b) for c, a, b in zip(cell, low, high, strict=True))


def cell_bounds(region: Window | None) -> NDArray[np.int64] | None:
    """Return the least and greatest cell (2, 3) of a region of interest, if there is one."""
    if region is None:
        return None
    return np.stack([region.first, np.add(region.first, region.shape) - 1])


def _brick(cell: Cell) -> Cell:
    return cell_of(at + below >> bits for at, below, bits in zip(cell, BELOW, BITS, strict=True))
