"""The interface of predictors: measured states in, log-odds of occupancy out.

A predictor is part of what a replay recomputes: the same states must give the same log-odds, bit
by bit, on every machine.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

STEPS = 64
"""Steps of a log-odds to a unit."""

NO_OPINION = 0
"""Log-odds of what a predictor says nothing of."""

PREDICTED_LAYERS = (0.0, 1.6)
"""Heights above the floor between which a prediction of columns holds, m."""

BAND = (0.3, 1.5)
"""Heights of what makes a column occupied, m: above what is stepped over, below lintels."""


class View(NamedTuple):
    """What was measured.

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
