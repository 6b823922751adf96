"""The interface of our own predictors: measured states in, log-odds of occupancy out.

Such a predictor is part of what a replay recomputes: the same states must give the same log-odds,
bit by bit, on every machine. One from outside has the interface of `map_box`.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.columns import WORD_BITS, Window, layer_bits
from wayproof.maps.grid import FLOOR_LAYER

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
        free: (nx, ny) other columns, of which at least half of the band was measured free.
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
