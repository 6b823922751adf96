"""Boxes of the map and their predictions, to and from protobuf."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.interface.message_values import triple, values_for
from wayproof.harness.interface.observation_messages import window_at
from wayproof.harness.prediction.predicted_box import PredictionError
from wayproof.harness.prediction.predictor import MapBox
from wayproof.harness.schema import stack_pb2 as sb


class Answer(NamedTuple):
    """Answer of a predictor.

    Attributes:
        log_odds: int8 in steps, of a box of cells, or of columns.
        offset: Least of these in the requested box, in cells.
    """

    log_odds: NDArray[np.int8]
    offset: tuple[int, ...] = (0, 0, 0)


def box_message(box: MapBox) -> sb.MapBox:
    """Return a box as another process gets it."""
    return sb.MapBox(**values_for(sb.MapBox, box), shape=box.states.shape)


def box_from(message: sb.MapBox) -> MapBox:
    """Decode a box in the predictor's process."""
    window = window_at(message.resolution, message.origin, message.shape)
    return MapBox(
        time_ns=message.time_ns,
        sequence=message.sequence,
        window=window,
        states=np.frombuffer(message.states, np.uint8).reshape(window.shape),
        position=np.array(triple(message.position)),
        quaternion=np.array(message.quaternion[:]),
    )


def read_answer(message: sb.Prediction, box: MapBox) -> Answer:
    """Decode the answer of another process.

    Raises:
        PredictionError: It is not of cells of the box, or not as many as it says.
    """
    requested = box.states.shape
    shape = tuple(message.shape) or requested
    offset = tuple(message.offset) or (0,) * len(shape)
    if len(shape) not in (2, 3) or len(offset) != len(shape) or min(shape) < 1:
        raise PredictionError(f"got shape {shape} at {offset}, expected cells along 3 or 2 axes")
    if any(low + size > most for low, size, most in zip(offset, shape, requested, strict=False)):
        raise PredictionError(
            f"got cells {shape} at {offset}, expected within the box of {requested}"
        )
    log_odds = np.frombuffer(message.log_odds, np.int8)
    if len(log_odds) != np.prod(shape, dtype=np.int64):
        raise PredictionError(f"got {len(log_odds)} log-odds, expected those of {shape}")
    return Answer(np.maximum(log_odds.reshape(shape), -127), offset)
