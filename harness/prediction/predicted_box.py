"""Predictions as the log holds them: log-odds of a box of cells, in whole sixteenths."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import zstandard
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.geometry import least_box
from wayproof.harness.prediction.predictor import MapBox
from wayproof.harness.schema import wayproof_pb2 as pb

STEPS = 16
"""Steps of a log-odds to a unit."""

MOST_STEPS = 127
"""Greatest log-odds in steps: p = 0.9996."""

MOST_CELLS = 1 << 25
"""Maximum number of cells of a box, requested or answered: a message holds them."""

FARTHEST = 1 << 24
"""Farthest cell along an axis: 1e4 m at 1 cm, and to spare."""

LEVEL = 3
"""Level of zstd: higher ones save a few percent and take several times as long."""


class PredictionError(ValueError):
    """Invalid prediction, in one line: what was got and expected."""


@dataclass(frozen=True)
class PredictedBox:
    """Log-odds of a box of cells, or of columns.

    Attributes:
        first: Least cell on the lattice of the map, (x, y, z); of columns z is of no account.
        log_odds: int8 in `STEPS` to a unit, (nx, ny, nz) of cells or (nx, ny) of columns; 0 where
            nothing is predicted.
    """

    first: tuple[int, int, int]
    log_odds: NDArray[np.int8]


def in_steps(answer: object, box: MapBox) -> NDArray[np.int8]:
    """Return the answer of a predictor in steps.

    Raises:
        PredictionError: It is no array of finite numbers of the shape of the box or its columns.
    """
    if not isinstance(answer, np.ndarray):
        raise PredictionError(f"got {type(answer).__name__}, expected an array of log-odds")
    if answer.dtype.kind not in "fiu":
        raise PredictionError(f"got an array of {answer.dtype}, expected one of numbers")
    shape = box.states.shape
    if answer.shape not in (shape, shape[:2]):
        raise PredictionError(
            f"got log-odds of shape {answer.shape}, expected {shape}, or {shape[:2]} of columns"
        )
    if answer.dtype.kind == "f" and not (finite := np.isfinite(answer)).all():
        place = tuple(np.argwhere(~finite)[0].tolist())
        raise PredictionError(f"got {answer[place]} at cell {place}, expected finite log-odds")
    most = MOST_STEPS / STEPS
    steps: NDArray[np.int8] = np.rint(np.clip(answer, -most, most) * STEPS).astype(np.int8)
    return steps


def prediction_message(
    blank: pb.Prediction, box: MapBox, answer: NDArray[np.int8], offset: tuple[int, ...] = (0, 0, 0)
) -> pb.Prediction:
    """Encode a prediction for the log: unmeasured cells, and only the part with an opinion.

    Args:
        blank: Message of the prediction without an opinion.
        box: Requested box.
        answer: Log-odds in steps of a box within it, or of columns.
        offset: Least cell of the answer in the box.
    """
    message = pb.Prediction()
    message.CopyFrom(blank)
    there = tuple(slice(low, low + size) for low, size in zip(offset, answer.shape, strict=False))
    kept = np.where(box.unmeasured(answer.shape)[there], answer, np.int8(0))
    if not kept.any():
        return message
    within = least_box(kept != 0)
    cut = np.ascontiguousarray(kept[within])
    low = [part.start + more for part, more in zip(within, offset, strict=False)]
    corner = np.add(box.window.first, [*low, 0][:3])
    message.first.extend(corner.tolist())
    message.shape.extend(cut.shape)
    message.log_odds = zstandard.compress(cut.tobytes(), LEVEL)
    return message


def blank_message(sequence: int, time_ns: int, predictor: str, late: bool = False) -> pb.Prediction:
    """Return a prediction without an opinion.

    Args:
        sequence: Number of the decision that it is an input of.
        time_ns: Simulated time of that decision, ns.
        predictor: As it calls itself.
        late: Whether it took longer than a period.
    """
    message = pb.Prediction(sequence=sequence, predictor=predictor, late=late)
    message.timestamp.FromNanoseconds(time_ns)
    return message


def read_prediction(message: pb.Prediction) -> PredictedBox | None:
    """Decode the log-odds of a message of unknown origin; None if it has no opinion.

    Raises:
        InputError: It is none.
    """
    if not message.shape:
        return None
    shape, first = tuple(message.shape), tuple(message.first)
    count = math.prod(shape)
    what = f"prediction of decision {message.sequence}"
    if len(shape) not in (2, 3) or len(first) != 3 or not 0 < count <= MOST_CELLS:
        raise InputError(
            f"{what}: {shape} cells from {first} on, expected up to {MOST_CELLS} along 2 or 3 axes"
        )
    if max(map(abs, first)) > FARTHEST:
        raise InputError(f"{what}: cells from {first} on, expected within {FARTHEST}")
    try:
        if zstandard.get_frame_parameters(message.log_odds).content_size != count:
            raise InputError(f"{what}: expected the log-odds of {shape} cells")
        data = zstandard.ZstdDecompressor().decompress(message.log_odds)
    except zstandard.ZstdError as error:
        raise InputError(f"{what}: {error}") from None
    x, y, z = first
    return PredictedBox((x, y, z), np.frombuffer(data, np.int8).reshape(shape))
