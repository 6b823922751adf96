"""The interfaces of predictors: measured states in, log-odds of occupancy out.

One of our own is part of what a replay recomputes: the same states must give the same log-odds, bit
by bit, on every machine. One from outside is a class with one method, and with a name if it likes:

    class MyPredictor:
        name = "mine 1.2"

        def predict(self, box: MapBox) -> NDArray: ...

It answers the natural logarithm of p / (1 - p) of occupancy, as floats: of the cells of the box, or
of its columns; 0 where it says nothing. What it answers is an input in the log, so that it may
compute as it likes. SI units, world frame z up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.columns import WORD_BITS, Window, layer_bits, pack
from wayproof.maps.grid import FLOOR_LAYER
from wayproof.maps.states import FREE, OCCUPIED, UNKNOWN

STEPS = 64
"""Steps of a log-odds to a unit."""

NO_OPINION = 0
"""Log-odds of cells without a prediction."""

PREDICTED_LAYERS = (0.0, 1.6)
"""Heights above the floor between which a prediction of columns holds, m."""

BAND = (0.3, 1.5)
"""Heights between which cells make a column occupied, m: above step height, below lintels."""


class View(NamedTuple):
    """Measured states of columns.

    Attributes:
        occupied: (nx, ny) columns in which something was measured occupied within `BAND`.
        free: (nx, ny) other columns, at least half of whose band was measured free.
        resolution: Edge of a cell, m.
    """

    occupied: NDArray[np.bool_]
    free: NDArray[np.bool_]
    resolution: float


class Predictor(Protocol):
    """A predictor of columns.

    Attributes:
        name: Its name in the registry.
    """

    name: ClassVar[str]

    def log_odds(self, view: View) -> NDArray[np.int32]:
        """Return the log-odds of occupancy of the columns (nx, ny), in `STEPS` to a unit.

        `NO_OPINION` where it says nothing; measured columns need no answer.
        """


def view_of(window: Window, occupied: NDArray[np.uint64], free: NDArray[np.uint64]) -> View:
    """Return a predictor's view of the columns of bits (nx, ny, words) of a window."""
    size, bottom = window.resolution, window.first[2]
    first, end = (FLOOR_LAYER + round(height / size) - bottom for height in BAND)
    band = layer_bits(max(first, 0), max(end, 0), WORD_BITS * occupied.shape[2])
    held = ((occupied & band) != 0).any(axis=2)
    counts = np.bitwise_count(free & band).astype(np.int64).sum(axis=2)
    return View(held, (2 * counts >= end - first) & ~held, size)


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
