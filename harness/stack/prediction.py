"""Predicted cells of a mission: a predictor's answer to the measured map, as a layer below it.

Our own predictors are computed again from the measured map at each decision. What one from outside
said is an input of the decision.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import Config
from wayproof.harness.inputs import Inputs
from wayproof.harness.mission import Mission
from wayproof.harness.prediction import PREDICTED_LAYERS, PREDICTORS, predicted_box, predictor
from wayproof.harness.prediction.predictor import view_of
from wayproof.harness.prediction_config import is_outside
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.maps import FREE, OCCUPIED, UNKNOWN
from wayproof.maps.columns import WORD_BITS, ColumnMap, Window
from wayproof.maps.elementary import logarithm
from wayproof.maps.grid import FLOOR_LAYER
from wayproof.maps.overlay import CellLayer

States = NDArray[np.uint8]


class Predicted(NamedTuple):
    """A prediction as an input of a decision.

    Attributes:
        message: As it is logged.
        took_ms: Wall time until it came, ms.
    """

    message: pb.Prediction
    took_ms: float


class Predictions(Protocol):
    """Predictions of a predictor from outside: live, or from a log."""

    def of(
        self, measured: ColumnMap, newest: Inputs, sequence: int, time_ns: int
    ) -> Predicted | None:
        """Return the prediction of a map; None without one.

        Args:
            measured: The map.
            newest: Inputs of the decision before, the newest that the map holds.
            sequence: Number of the decision that the prediction is an input of.
            time_ns: Simulated time of that decision.
        """


class PredictedLayer(Protocol):
    """A layer of predicted cells.

    Attributes:
        cells: Unknown where nothing is predicted.
    """

    cells: CellLayer

    def follow(self, measured: ColumnMap, inputs: Inputs) -> None:
        """Bring it up to date for a decision, whose inputs the measured map holds."""


def predicted_layer(config: Config, mission: Mission) -> PredictedLayer:
    """Return the layer of the predictor of a config, without predictions.

    Raises:
        ValueError: The predictor is for cells of another size.
    """
    kind = GivenCells if is_outside(config.prediction.source) else ComputedCells
    return kind(config, mission)


class Thresholds:
    """Thresholds of the states, by log-odds in whole steps."""

    def __init__(self, config: Config, steps: int) -> None:
        """Take the probabilities of a config, for log-odds of a number of steps to a unit."""
        settings = config.prediction
        self._occupied_from = math.ceil(steps * _log_odds(settings.occupied_from))
        self._free_below = math.floor(steps * _log_odds(settings.free_below))

    def states(self, log_odds: NDArray[np.signedinteger]) -> States:
        """Return states of an array of log-odds in steps."""
        return np.where(
            log_odds >= self._occupied_from,
            np.uint8(OCCUPIED),
            np.where(log_odds <= self._free_below, np.uint8(FREE), np.uint8(UNKNOWN)),
        )


class ComputedCells:
    """Cells that one of our own predictors computes from the measured map.

    Attributes:
        cells: The layer: predicted columns from the floor up.
    """

    def __init__(self, config: Config, mission: Mission) -> None:
        """Make a layer without predictions.

        Raises:
            ValueError: The predictor is for cells of another size.
        """
        self._predictor = PREDICTORS[config.prediction.source]()
        self._window = Window.covering(mission.low, mission.high, config.map.resolution)
        self.cells = CellLayer(self._window)
        self._thresholds = Thresholds(config, predictor.STEPS)
        self._columns = np.zeros(self._window.shape[:2], np.uint8)
        self._layers = layers_of_columns(self._window)
        none = np.zeros((*self._columns.shape, 1), np.uint64)
        self._predictor.log_odds(view_of(self._window, none, none))

    def follow(self, measured: ColumnMap, inputs: Inputs) -> None:
        """Predict again from a measured map; only changed cells are put into the layer."""
        nx, ny, nz = self._window.shape
        words = -(-nz // WORD_BITS)
        odds = self._predictor.log_odds(
            view_of(self._window, *measured.columns(self._window.first, (nx, ny, words)))
        )
        columns = self._thresholds.states(odds)
        changed = np.argwhere(columns != self._columns)
        self._columns = columns
        if len(changed):
            self._put(*changed.min(axis=0).tolist(), *(changed.max(axis=0) + 1).tolist())

    def _put(self, x0: int, y0: int, x1: int, y1: int) -> None:
        """Put a box of predicted columns into the layer."""
        low, high = self._layers
        first = np.add(self._window.first, (x0, y0, low)).tolist()
        states = standing(self._columns[x0:x1, y0:y1], high - low)
        self.cells.put((first[0], first[1], first[2]), states)


class GivenCells:
    """Cells that a predictor from outside gave with the inputs of a decision.

    Attributes:
        cells: The layer: what the newest decision was given; of columns from the floor up.
    """

    def __init__(self, config: Config, mission: Mission) -> None:
        """Make a layer without predictions."""
        self._window = Window.covering(mission.low, mission.high, config.map.resolution)
        self.cells = CellLayer(self._window)
        self._thresholds = Thresholds(config, predicted_box.STEPS)
        self._layers = layers_of_columns(self._window)
        self._states = np.zeros(self._window.shape, np.uint8)

    def follow(self, measured: ColumnMap, inputs: Inputs) -> None:
        """Replace the predictions by those of the inputs; only changed cells are put again."""
        states = np.zeros_like(self._states)
        if inputs.prediction is not None:
            self._place(inputs.prediction, states)
        changed = _least_box(states != self._states)
        self._states = states
        if changed is not None:
            x, y, z = (part.start for part in changed)
            first = np.add(self._window.first, (x, y, z)).tolist()
            self.cells.put((first[0], first[1], first[2]), states[changed])

    def _place(self, given: predicted_box.PredictedBox, states: States) -> None:
        """Write the part of a box that lies in the window into states (nx, ny, nz)."""
        found, first = self._thresholds.states(given.log_odds), np.array(given.first)
        if found.ndim == 2:
            low, high = self._layers
            found = standing(found, high - low)
            first[2] = self._window.first[2] + low
        begin = np.maximum(first, self._window.first)
        end = np.minimum(first + found.shape, np.add(self._window.first, self._window.shape))
        if (begin < end).all():
            here, there = (
                tuple(slice(a, b) for a, b in zip(begin - low, end - low, strict=True))
                for low in (self._window.first, first)
            )
            states[here] = found[there]


def layers_of_columns(window: Window) -> tuple[int, int]:
    """Return the first layer of a window with predicted columns, and the one past the last."""
    low, high = (FLOOR_LAYER + round(height / window.resolution) for height in PREDICTED_LAYERS)
    bottom = window.first[2]
    return max(low - bottom, 0), min(high - bottom, window.shape[2])


def standing(columns: States, layers: int) -> States:
    """Return states (nx, ny, layers) of columns (nx, ny) from the floor, which known ones have."""
    states = np.repeat(columns[:, :, None], layers, axis=2)
    states[:, :, 0] = np.where(columns == UNKNOWN, np.uint8(UNKNOWN), np.uint8(OCCUPIED))
    return states


def _least_box(changed: NDArray[np.bool_]) -> tuple[slice, slice, slice] | None:
    """Return the least box that holds all cells that are set; None without any."""
    parts = []
    for others in ((1, 2), (0, 2), (0, 1)):
        held = np.flatnonzero(changed.any(axis=others))
        if not len(held):
            return None
        parts.append(slice(int(held[0]), int(held[-1]) + 1))
    return parts[0], parts[1], parts[2]


def _log_odds(probability: float) -> float:
    return logarithm(probability) - logarithm(1.0 - probability)
