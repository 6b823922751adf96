"""Endpoints of the beams of a sweep as the kernels pack them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.kernels import beams
from wayproof.maps.sweep import Sweep
from wayproof.maps.voxel.frame import Cell, Frame, clipped

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
