"""Predicted cells of a mission: the measured map through a predictor into a layer."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.mission import Mission
from wayproof.harness.prediction import PREDICTED_LAYERS, PREDICTORS, View
from wayproof.harness.prediction.predictor import BAND, STEPS
from wayproof.maps import FREE, OCCUPIED, UNKNOWN
from wayproof.maps.columns import WORD_BITS, ColumnMap, Window, layer_bits
from wayproof.maps.elementary import logarithm
from wayproof.maps.grid import FLOOR_LAYER
from wayproof.maps.overlay import CellLayer

States = NDArray[np.uint8]


class PredictedCells:
    """A layer that follows the measured map.

    Attributes:
        cells: The layer: predicted columns from the floor up, unknown where nothing is predicted.
    """

    def __init__(self, config: Config, mission: Mission) -> None:
        """Make a layer without predictions.

        Raises:
            ValueError: The predictor is for cells of another size.
        """
        settings, size = config.prediction, config.map.resolution
        self._predictor = PREDICTORS[settings.source]()
        self._window = Window.covering(mission.low, mission.high, size)
        self.cells = CellLayer(self._window)
        self._occupied_from = math.ceil(STEPS * _log_odds(settings.occupied_from))
        self._free_below = math.floor(STEPS * _log_odds(settings.free_below))
        self._columns = np.zeros(self._window.shape[:2], np.uint8)
        low, high = (FLOOR_LAYER + round(height / size) for height in PREDICTED_LAYERS)
        bottom = self._window.first[2]
        self._layers = max(low - bottom, 0), min(high - bottom, self._window.shape[2])
        none = np.zeros((*self._columns.shape, 1), np.uint64)
        self._predictor.log_odds(view_of(self._window, none, none))

    def follow(self, measured: ColumnMap) -> None:
        """Predict anew from a measured map; only what changes is put into the layer."""
        nx, ny, nz = self._window.shape
        words = -(-nz // WORD_BITS)
        odds = self._predictor.log_odds(
            view_of(self._window, *measured.columns(self._window.first, (nx, ny, words)))
        )
        columns = np.where(
            odds >= self._occupied_from,
            np.uint8(OCCUPIED),
            np.where(odds <= self._free_below, np.uint8(FREE), np.uint8(UNKNOWN)),
        )
        changed = np.argwhere(columns != self._columns)
        self._columns = columns
        if len(changed):
            self._put(*changed.min(axis=0).tolist(), *(changed.max(axis=0) + 1).tolist())

    def _put(self, x0: int, y0: int, x1: int, y1: int) -> None:
        """Put a box of predicted columns into the layer: free ones have a floor."""
        low, high = self._layers
        columns = self._columns[x0:x1, y0:y1]
        states = np.repeat(columns[:, :, None], high - low, axis=2)
        states[:, :, 0] = np.where(columns == UNKNOWN, np.uint8(UNKNOWN), np.uint8(OCCUPIED))
        first = np.add(self._window.first, (x0, y0, low)).tolist()
        self.cells.put((first[0], first[1], first[2]), states)


def view_of(window: Window, occupied: NDArray[np.uint64], free: NDArray[np.uint64]) -> View:
    """What a predictor sees of the columns of bits (nx, ny, words) of a window."""
    size, bottom = window.resolution, window.first[2]
    first, end = (FLOOR_LAYER + round(height / size) - bottom for height in BAND)
    band = layer_bits(max(first, 0), max(end, 0), WORD_BITS * occupied.shape[2])
    held = ((occupied & band) != 0).any(axis=2)
    counts = np.bitwise_count(free & band).astype(np.int64).sum(axis=2)
    return View(held, (2 * counts >= end - first) & ~held, size)


def _log_odds(probability: float) -> float:
    return logarithm(probability) - logarithm(1.0 - probability)
