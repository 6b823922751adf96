"""The map of one file that CONTRIBUTING asks for: log-odds as plain numbers, on `DenseMap`."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from wayproof.maps.dense import Cells, DenseMap
from wayproof.maps.states import FREE, OCCUPIED, UNKNOWN


class CountingMap(DenseMap):
    """The difference of hits and misses of each cell, in thirtieths of log-odds.

    With the default settings these are the steps, the clamps and so the states of `VoxelMap`.
    """

    layers: ClassVar = {"value": np.int16}

    def update(self, cells: Cells, hits: NDArray[np.bool_], misses: NDArray[np.bool_]) -> None:
        """Add 27 for a hit, take 12 for a miss."""
        value = cells["value"]
        value += 27 * hits - 12 * misses
        np.clip(value, -60, 104, out=value)

    def states(self, cells: Cells) -> NDArray[np.uint8]:
        """By the sign of the value."""
        value = cells["value"]
        return np.select([value > 0, value < 0], [OCCUPIED, FREE], UNKNOWN).astype(np.uint8)

    def probabilities(self, cells: Cells) -> NDArray[np.float64]:
        """The logistic function of the log-odds."""
        return 1.0 / (1.0 + np.exp(-cells["value"] / 30.0))


class HalvingMap(CountingMap):
    """The same with decay: each tick halves the values, toward 0."""

    def decay(self, cells: Cells, ticks: int) -> None:
        """Halve the values once a tick."""
        value = cells["value"]
        value[:] = np.sign(value) * (np.abs(value) >> min(ticks, 15))
