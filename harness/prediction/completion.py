"""A small network that completes measured columns: is an unknown column occupied?

It sees, around a column, how many of the cells were measured occupied and free: one by one, in
blocks of 3 x 3 and of 9 x 9, 7 x 7 of each. Two hidden layers of rectifiers lead to one log-odds.
Inputs and weights are whole numbers, and all sums stay below 2^53, so that floats hold them exactly
and no order of summation changes a bit.
"""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.prediction.predictor import NO_OPINION, STEPS, View

WEIGHTS = Path(__file__).with_name("completion.json")

CELL = 0.1
"""Edge of the cells that it was trained on, m."""

BLOCKS = (1, 3, 9)
"""Edges of the blocks of each scale, cells."""

HALF = 3
"""Blocks to each side of the middle one."""

INPUT_SCALE = 81
"""A whole block of any scale, as an input."""

WEIGHT_SCALE = 1024
"""Steps of a weight to a unit."""

REACH = 20
"""Greatest distance from a measured column at which it predicts, cells."""

STRIDE = 2
"""Spacing of the columns that are predicted, along x and y; those between take the prediction."""

MOST_LOG_ODDS = 6 * STEPS

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


class Layer(NamedTuple):
    """Weights (inputs, outputs) and biases (outputs,) in whole steps, held as floats."""

    weights: Floats
    biases: Floats


class Completion:
    """The network, with the weights that come with the package."""

    name: ClassVar[str] = "completion"

    def __init__(self) -> None:
        """Read the weights."""
        self._layers = read_weights()

    def log_odds(self, view: View) -> NDArray[np.int32]:
        """Return the log-odds of the columns (nx, ny).

        Raises:
            ValueError: The cells are of another size.
        """
        if abs(view.resolution - CELL) > 1e-9:
            raise ValueError(
                f"prediction.source: 'completion' is for cells of {CELL:g} m, got "
                f"{view.resolution:g} m"
            )
        nx, ny = view.occupied.shape
        answers = np.full((nx, ny), NO_OPINION, np.int32)
        places = places_of(view)
        if len(places):
            found = evaluated(self._layers, features_at(view, places))
            for dx in range(STRIDE):
                for dy in range(STRIDE):
                    x = np.minimum(places[:, 0] + dx, nx - 1)
                    y = np.minimum(places[:, 1] + dy, ny - 1)
                    answers[x, y] = found
        return answers


def places_of(view: View) -> Ints:
    """Select the columns (n, 2) to predict: unknown, near a measured one, each `STRIDE`-th."""
    known = view.occupied | view.free
    near = _box_sums(known.astype(np.int64), 2 * REACH + 1) > 0
    unknown_near = near & ~known
    # A place stands for all columns up to the next one.
    padded = np.pad(
        unknown_near, [(0, -unknown_near.shape[0] % STRIDE), (0, -unknown_near.shape[1] % STRIDE)]
    )
    blocks = np.zeros(padded[::STRIDE, ::STRIDE].shape, np.bool_)
    for dx in range(STRIDE):
        for dy in range(STRIDE):
            blocks |= padded[dx::STRIDE, dy::STRIDE]
    places: Ints = np.argwhere(blocks) * STRIDE
    return places


def features_at(view: View, places: Ints) -> Floats:
    """Return inputs (n, inputs) of the network at columns (n, 2): whole numbers, 0 to 81."""
    parts = []
    offsets = np.arange(-HALF, HALF + 1)
    for block in BLOCKS:
        pad = HALF * block + block // 2  # blocks that reach over the border count what is inside
        x = places[:, 0, None] + pad + block * offsets[None]
        y = places[:, 1, None] + pad + block * offsets[None]
        for cells in (view.occupied, view.free):
            sums = _box_sums(np.pad(cells.astype(np.int64), pad), block)
            blocks = sums[x[:, :, None], y[:, None, :]] * (INPUT_SCALE // block**2)
            parts.append(blocks.reshape(len(places), -1))
    return np.concatenate(parts, axis=1).astype(np.float64)


def evaluated(layers: list[Layer], inputs: Floats) -> NDArray[np.int32]:
    """Return log-odds (n,) of inputs (n, inputs), in steps."""
    values = inputs
    for number, layer in enumerate(layers):
        values = np.matmul(values, layer.weights) + layer.biases
        if number < len(layers) - 1:
            values = np.maximum(values, 0.0)
    unit = float(INPUT_SCALE * WEIGHT_SCALE ** len(layers))
    steps = np.floor(values[:, 0] / unit * STEPS)
    bounded = np.clip(steps, -MOST_LOG_ODDS, MOST_LOG_ODDS).astype(np.int32)
    return np.where(bounded == NO_OPINION, np.int32(1), bounded)


@lru_cache(1)
def read_weights() -> list[Layer]:
    """Read the weights: whole numbers, whose sums stay exact in floats.

    Raises:
        ValueError: Sums of them could need more than 53 bits.
    """
    document = json.loads(WEIGHTS.read_text(encoding="utf-8"))
    layers = [
        Layer(np.array(one["weights"], np.float64), np.array(one["biases"], np.float64))
        for one in document["layers"]
    ]
    check_exact(layers)
    return layers


def check_exact(layers: list[Layer]) -> None:
    """Raise a ValueError unless every sum of a network stays below 2^53 for any input."""
    most = np.full(len(layers[0].weights), float(INPUT_SCALE))
    for layer in layers:
        reached = np.matmul(most, np.abs(layer.weights)) + np.abs(layer.biases)
        if reached.max() >= 2.0**53:
            raise ValueError(f"weights: sums up to {reached.max():.3g}, expected below 2^53")
        most = reached


def _box_sums(cells: Ints, edge: int) -> Ints:
    """Sum over boxes of an odd edge about each cell; nothing lies outside."""
    half = edge // 2
    padded = np.pad(cells, ((half + 1, half), (half + 1, half)))
    sums = padded.cumsum(axis=0).cumsum(axis=1)
    boxes: Ints = sums[edge:, edge:] - sums[:-edge, edge:] - sums[edge:, :-edge]
    boxes += sums[:-edge, :-edge]
    return boxes
