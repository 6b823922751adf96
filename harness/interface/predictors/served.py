"""A predictor of Python behind the messages of a harness in another process."""

from __future__ import annotations

import numpy as np

from wayproof.harness.errors import InputError
from wayproof.harness.interface.observation_messages import hello
from wayproof.harness.interface.predictors.connect import SETTING, in_process, runs_in_process
from wayproof.harness.prediction.map_box import MapBox
from wayproof.harness.prediction.predicted_box import in_steps
from wayproof.harness.schema import stack_pb2 as sb
from wayproof.maps.columns import Window
from wayproof.maps.grid import FLOOR_HEIGHT_IN_CELL


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
        """The answer to a hello or a box; None to anything else.

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
        """Nothing: boxes are not announced."""

    def close(self) -> None:
        """Nothing to end."""


def box_from(message: sb.MapBox) -> MapBox:
    """A box, in the predictor's process."""
    size, origin = message.resolution, message.origin
    shift = np.array([0.0, 0.0, FLOOR_HEIGHT_IN_CELL])
    corner = np.rint(np.array([origin.x, origin.y, origin.z]) / size + shift)
    x, y, z = corner.astype(np.int64).tolist()
    nx, ny, nz = message.shape
    return MapBox(
        time_ns=message.time_ns,
        sequence=message.sequence,
        window=Window(size, (x, y, z), (nx, ny, nz)),
        states=np.frombuffer(message.states, np.uint8).reshape(nx, ny, nz),
        position=np.array([message.position.x, message.position.y, message.position.z]),
        quaternion=np.array(message.quaternion[:]),
    )
