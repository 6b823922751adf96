"""The interface of predictors from outside: a box of the measured map in, log-odds out.

A predictor is a class with one method, and with a name if it likes:

    class MyPredictor:
        name = "mine 1.2"

        def predict(self, box: MapBox) -> NDArray: ...

It answers the natural logarithm of p / (1 - p) of occupancy, as floats: of the cells of the box, or
of its columns; 0 where it says nothing. What it answers is an input in the log, so that it may
compute as it likes. SI units, world frame z up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.prediction.predictor import View, view_of
from wayproof.maps.columns import Window, pack
from wayproof.maps.states import FREE, OCCUPIED, UNKNOWN

PADDED = 64
"""Bits of a word; cells of a column are packed in whole words."""


Shape = tuple[int | None, int | None, int | None]
"""Cells of a box along x, y and z; None for any number."""

ANY_SHAPE: Shape = (None, None, None)


@dataclass(frozen=True)
class MapBox:
    """Measured states of a box about the robot.

    Attributes:
        time_ns: Simulated time of the newest sweeps in the map.
        sequence: Number of the decision that the prediction is an input of.
        window: The cells of the box on the lattice of the map.
        states: (nx, ny, nz) uint8, read-only: 0 unknown, 1 free, 2 occupied.
        position: (3,) estimated position of the base, m.
        quaternion: (4,) estimated T_world_base, w x y z.
    """

    time_ns: int
    sequence: int
    window: Window
    states: NDArray[np.uint8]
    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]

    @property
    def resolution(self) -> float:
        """Edge of a cell, m."""
        return self.window.resolution

    @property
    def origin(self) -> NDArray[np.float64]:
        """(3,) least corner of the box, m, world."""
        return self.window.origin

    def columns(self) -> View:
        """Return the columns (nx, ny) occupied, and free, between step height and a lintel."""
        nx, ny, nz = self.states.shape
        bits = []
        for state in (OCCUPIED, FREE):
            cells = np.zeros((nx, ny, -(-nz // PADDED) * PADDED), np.bool_)
            cells[:, :, :nz] = self.states == state
            bits.append(pack(cells))
        return view_of(self.window, *bits)

    def unmeasured(self, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        """Return a mask of the cells, or columns by a shape of two axes, without measurements."""
        if len(shape) == 2:
            view = self.columns()
            return ~(view.occupied | view.free)
        unknown: NDArray[np.bool_] = self.states == UNKNOWN
        return unknown


class BoxPredictor(Protocol):
    """A predictor from outside, in this process."""

    def predict(self, box: MapBox) -> NDArray[np.floating]:
        """Return log-odds of occupancy, (nx, ny, nz) of the cells or (nx, ny) of the columns."""
