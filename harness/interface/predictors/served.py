"""A predictor of Python behind the messages of a harness in another process."""

from __future__ import annotations

import numpy as np

from wayproof.harness.errors import InputError
from wayproof.harness.interface.observation_messages import hello, window_at
from wayproof.harness.interface.predictors.connect import SETTING, in_process, runs_in_process
from wayproof.harness.prediction.map_box import MapBox
from wayproof.harness.prediction.predicted_box import in_steps
from wayproof.harness.schema import stack_pb2 as sb


class ServedPredictor:
    """Answers boxes with the predictions of a class, or of a network's file."""

    def __init__(self, source: str) -> None:
        """Make it.

        Raises:
            InputError: There is none.
        """
        if not runs_in_process(source):
            raise InputError(f"{SETTING}: got '{source}', expected module:Class or FILE.onnx")
        self._predictor, self._name = in_process(source)

    def answer(self, message: sb.ToStack) -> sb.FromStack | None:
        """Return the answer to a hello or a box; None to anything else.

        Raises:
            PredictionError: What it returned is no prediction.
        """
        kind = message.WhichOneof("kind")
        if kind == "hello":
            greeting = hello(self._name)
            greeting.role = "predictor"
            return sb.FromStack(hello=greeting)
        if kind != "map_box":
            return None
        box = box_from(message.map_box)
        log_odds = in_steps(self._predictor.predict(box), box)
        answer = sb.Prediction(
            sequence=box.sequence, shape=log_odds.shape, log_odds=log_odds.tobytes()
        )
        return sb.FromStack(prediction=answer)

    def rehearse(self) -> None:
        """Do nothing: boxes are not announced."""

    def close(self) -> None:
        """Do nothing: there is nothing to end."""


def box_from(message: sb.MapBox) -> MapBox:
    """Decode a box in the predictor's process."""
    window = window_at(message.resolution, message.origin, message.shape)
    return MapBox(
        time_ns=message.time_ns,
        sequence=message.sequence,
        window=window,
        states=np.frombuffer(message.states, np.uint8).reshape(window.shape),
        position=np.array([message.position.x, message.position.y, message.position.z]),
        quaternion=np.array(message.quaternion[:]),
    )
