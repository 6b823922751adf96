"""Endpoints of the beams of a sweep as the kernels pack them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.columns import Window
from wayproof.maps.kernels import beams, bricks
from wayproof.maps.sweep import Sweep
from wayproof.maps.voxel.bricks import BELOW, BITS

MAX_WINDOW_WORDS = 1 << 26


@dataclass(frozen=True)
class SweepEndpoints:
    """Endpoints of the beams of a sweep.

    Attributes:
        ends: (k,) endpoints of informative beams as the kernels pack them; reused for each sweep.
        counts: Beams by fate.
        box: Least and greatest cell of all beams within the bounds.
        frame: The bricks around that box.
    """

    ends: NDArray[np.int64]
    counts: list[int]
    box: tuple[Cell, Cell]
    frame: Frame


class EndpointFinder:
    """Places the beams of sweeps; its memory is used again."""

    def __init__(self, bounds: NDArray[np.int64] | None) -> None:
        """Start without memory.

        Args:
            bounds: (2, 3) least and greatest cell that may be marked; None for no bounds.
        """
        self._bounds = bounds
        self._ends = np.empty(0, np.int64)

    def find(self, sweep: Sweep) -> SweepEndpoints:
        """Find the endpoints of a sweep.

        Raises:
            ValueError: A direction is not of unit length, or the beams span too much space.
        """
        if len(self._ends) < len(sweep.ranges_mm):
            self._ends = np.empty(len(sweep.ranges_mm), np.int64)
        box, counts = np.empty((2, 3), np.int64), np.zeros(4, np.int64)
        listed = beams.place_ends(
            beams.SweepBeams(
                sweep.origins,
                sweep.sensors,
                sweep.groups,
                sweep.directions.reshape(-1),
                sweep.ranges_mm,
                sweep.limits_mm,
                sweep.resolution,
            ),
            beams.EndLists(self._ends, box, counts),
            np.empty((4, beams.CHUNK), np.int64),
            np.empty(beams.CHUNK, np.int64),
        )
        if listed < 0:
            squared = np.square(sweep.directions).sum(axis=1)
            strange = ~(np.abs(squared - 1.0) < beams.UNIT_TOLERANCE)  # also NaN
            raise ValueError(
                f"directions: got {sweep.directions[strange][0]}, expected unit length"
            )
        low, high = (clipped(cell, self._bounds) for cell in box.tolist())
        return SweepEndpoints(
            ends=self._ends[:listed],
            counts=counts.tolist(),
            box=(low, high),
            frame=_frame_of_beams(low, high),
        )


def _frame_of_beams(low: Cell, high: Cell) -> Frame:
    """Return the frame of the cells of beams.

    Raises:
        ValueError: The beams span too much space.
    """
    frame = Frame.around(low, high)
    words = math.prod(frame.shape)
    if words > MAX_WINDOW_WORDS:
        raise ValueError(
            f"beams: got {64 * words} cells around them, expected at most {64 * MAX_WINDOW_WORDS}: "
            "a shorter range or coarser cells"
        )
    return frame


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
