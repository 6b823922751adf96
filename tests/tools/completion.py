"""Train the completion network on maps of generated worlds, and measure its calibration.

Usage: python -m tests.tools.completion LOGS HELD_OUT

Both are folders of logs of generated worlds, such as a study's, of other seeds. The columns near
the border of what was measured are the samples, and the world's geometry says which of them are
occupied. The weights are rounded to whole steps and written into the package; the figures are those
of the rounded network on the held-out worlds.
"""

from __future__ import annotations

import argparse
import itertools
import json
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.log.reader import open_log
from wayproof.harness.prediction.completion import (
    INPUT_SCALE,
    WEIGHT_SCALE,
    WEIGHTS,
    Layer,
    check_exact,
    evaluated,
    features_at,
    places_of,
)
from wayproof.harness.prediction.predictor import BAND, STEPS, view_of
from wayproof.harness.prior.truth import grid_of_world
from wayproof.harness.scenario.worlds import generate
from wayproof.harness.stack.mapping import Mapper
from wayproof.maps import OCCUPIED
from wayproof.maps.columns import WORD_BITS, Window
from wayproof.maps.grid import FLOOR_LAYER

Array = NDArray[np.float32]

EVERY = 15
"""Decisions from one sample of a map to the next."""

PLACES = 500
"""Columns taken of each map at most."""

HIDDEN = (48, 24)
EPOCHS, BATCH, RATE = 20, 2048, 2e-3


class Samples(NamedTuple):
    """Inputs (n, inputs) in whole numbers, and whether each column is occupied (n,)."""

    inputs: Array
    occupied: Array


def samples_of(path: Path) -> Iterator[Samples]:
    """Yield the samples of the maps of a log."""
    log = open_log(path)
    config, mission = log.config, log.mission
    window = Window.covering(mission.low, mission.high, config.map.resolution)
    truth = grid_of_world(generate(config), config.map.resolution).states
    size, bottom = window.resolution, window.first[2]
    first, end = (FLOOR_LAYER + round(height / size) - bottom for height in BAND)
    occupied = (truth[:, :, first:end] == OCCUPIED).any(axis=2)
    mapper = Mapper(config, mission, log.beams)
    rng = np.random.default_rng(config.seed)
    words = -(-window.shape[2] // WORD_BITS)
    for record in log.records():
        mapper.integrate(record.inputs)
        if record.inputs.sequence % EVERY:
            continue
        bits = mapper.map.columns(window.first, (*window.shape[:2], words))
        view = view_of(window, *bits)
        places = places_of(view)
        known = view.occupied | view.free
        places = places[~known[tuple(places.T)]]
        places = places[rng.permutation(len(places))[:PLACES]]
        if len(places):
            yield Samples(
                features_at(view, places).astype(np.float32),
                occupied[tuple(places.T)].astype(np.float32),
            )


def gathered(folder: Path) -> Samples:
    """Return the samples of all logs in a folder that have neither a prior nor predictions."""
    parts: list[Samples] = []
    for path in sorted(folder.glob("*.mcap")):
        if not open_log(path).config.has_layers:
            parts += samples_of(path)
    print(f"{folder}: {sum(len(part.occupied) for part in parts)} samples", flush=True)
    return Samples(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def trained(samples: Samples, seed: int = 0) -> list[tuple[Array, Array]]:
    """Return weights by Adam (Kingma and Ba 2015) on the cross entropy."""
    rng = np.random.default_rng(seed)
    sizes = [samples.inputs.shape[1], *HIDDEN, 1]
    weights = [
        (rng.standard_normal((a, b)) * np.sqrt(2.0 / a)).astype(np.float32)
        for a, b in itertools.pairwise(sizes)
    ]
    parameters = [*weights, *(np.zeros(b, np.float32) for b in sizes[1:])]
    first, second = ([np.zeros_like(one) for one in parameters] for _ in range(2))
    step, count, layers = 0, len(samples.occupied), len(weights)
    for epoch in range(EPOCHS):
        order, loss = rng.permutation(count), 0.0
        rate = RATE * 0.5 * (1.0 + np.cos(np.pi * epoch / EPOCHS))
        for begin in range(0, count - BATCH + 1, BATCH):
            rows = order[begin : begin + BATCH]
            values = [samples.inputs[rows] / INPUT_SCALE]
            for k in range(layers):
                after = values[-1] @ parameters[k] + parameters[layers + k]
                values.append(np.maximum(after, 0.0) if k < layers - 1 else after)
            odds, truth = values[-1][:, 0], samples.occupied[rows]
            p = 1.0 / (1.0 + np.exp(-odds))
            loss += float((np.logaddexp(0.0, odds) - truth * odds).sum())
            slope = ((p - truth) / len(rows))[:, None]
            gradients: list[Array] = [np.empty(0, np.float32)] * (2 * layers)
            for k in range(layers - 1, -1, -1):
                gradients[k] = values[k].T @ slope + 1e-5 * parameters[k]
                gradients[layers + k] = slope.sum(axis=0)
                slope = (slope @ parameters[k].T) * (values[k] > 0.0)
            step += 1
            for k, gradient in enumerate(gradients):
                first[k] += 0.1 * (gradient - first[k])
                second[k] += 0.001 * (gradient * gradient - second[k])
                mean, square = first[k] / (1.0 - 0.9**step), second[k] / (1.0 - 0.999**step)
                parameters[k] -= (rate * mean / (np.sqrt(square) + 1e-8)).astype(np.float32)
        print(f"epoch {epoch}: cross entropy {loss / max(count, 1):.4f}", flush=True)
    return [(parameters[k], parameters[layers + k]) for k in range(layers)]


def rounded(parameters: list[tuple[Array, Array]]) -> list[Layer]:
    """Return the network in whole steps, checked to be exact."""
    layers = []
    for number, (weights, biases) in enumerate(parameters, 1):
        scale = float(INPUT_SCALE * WEIGHT_SCALE**number)
        layers.append(
            Layer(
                np.rint(weights.astype(np.float64) * WEIGHT_SCALE),
                np.rint(biases.astype(np.float64) * scale),
            )
        )
    check_exact(layers)
    return layers


def write(layers: list[Layer]) -> None:
    """Write the weights into the package."""
    document = {
        "layers": [
            {
                "weights": layer.weights.astype(int).tolist(),
                "biases": [int(bias) for bias in layer.biases],
            }
            for layer in layers
        ]
    }
    WEIGHTS.write_text(json.dumps(document, separators=(",", ":")) + "\n", encoding="utf-8")


def print_calibration(layers: list[Layer], samples: Samples, base: float) -> None:
    """Print the reliability and the Brier score of a network on samples.

    Args:
        layers: The network.
        samples: Samples of worlds that it was not trained on.
        base: Share of occupied columns in the training, the constant forecast to compare with.
    """
    odds = evaluated(layers, samples.inputs.astype(np.float64)) / STEPS
    p, occupied = 1.0 / (1.0 + np.exp(-odds)), samples.occupied
    brier, constant = np.mean((p - occupied) ** 2), np.mean((base - occupied) ** 2)
    print(
        f"{len(p)} columns, {occupied.mean():.3f} occupied; Brier {brier:.4f}, "
        f"of a constant {constant:.4f}, skill {1.0 - brier / constant:.3f}"
    )
    print("| predicted | columns | mean predicted | truly occupied |\n|---|---|---|---|")
    for low in np.arange(0.0, 1.0, 0.1):
        inside = (p >= low) & (p < low + 0.1)
        if inside.any():
            print(
                f"| {low:.1f} to {low + 0.1:.1f} | {inside.sum()} | {p[inside].mean():.3f} | "
                f"{occupied[inside].mean():.3f} |"
            )
    gap = sum(
        abs(p[inside].mean() - occupied[inside].mean()) * inside.mean()
        for low in np.arange(0.0, 1.0, 0.1)
        if (inside := (p >= low) & (p < low + 0.1)).any()
    )
    print(f"expected calibration error {gap:.4f}")


def main() -> None:
    """Gather, train, round, write, measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("logs", type=Path)
    parser.add_argument("held_out", type=Path)
    options = parser.parse_args()
    training = gathered(options.logs)
    layers = rounded(trained(training))
    write(layers)
    print_calibration(layers, gathered(options.held_out), float(training.occupied.mean()))


if __name__ == "__main__":
    main()
