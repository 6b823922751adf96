"""Ways in for a predictor from outside: a class, a network's file, a command, a socket."""

from __future__ import annotations

import contextlib
import hashlib
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError, printable
from wayproof.harness.interface.connect import EXEC, SOCKETS
from wayproof.harness.interface.connection import ChildProcess, Connection, Socket
from wayproof.harness.interface.errors import (
    PREDICTOR_CAUSES,
    PredictorError,
    Way,
    code_from_outside,
)
from wayproof.harness.interface.remote import Peer
from wayproof.harness.prediction.map_box import BoxPredictor, MapBox
from wayproof.harness.prediction.predicted_box import PredictionError, in_steps
from wayproof.harness.prediction_config import ONNX_FILE
from wayproof.harness.schema import stack_pb2 as sb
from wayproof.planners.ompl._plugin import UserCodeError, load_class, source_digest, user_code

SETTING = "prediction.source"

MOST_NAME = 80
"""Most characters of a predictor's name that the log keeps."""

Shape = tuple[int | None, int | None, int | None]
"""Cells of a box along x, y and z; None for any number."""

ANY_SHAPE: Shape = (None, None, None)


class Answer(NamedTuple):
    """Answer of a predictor.

    Attributes:
        log_odds: int8 in steps, of a box of cells, or of columns.
        offset: Least of these in the requested box, in cells.
    """

    log_odds: NDArray[np.int8]
    offset: tuple[int, ...] = (0, 0, 0)


class PredictorSession(Protocol):
    """A predictor that is connected.

    Attributes:
        name: Name by which it calls itself.
        shape: Cells of the boxes that it takes.
    """

    name: str
    shape: Shape

    def query(self, box: MapBox) -> Answer:
        """Return its prediction of a box.

        Raises:
            PredictorError: It failed, or what came is no prediction.
        """

    def close(self) -> None:
        """End the predictor."""

    def stderr(self) -> str:
        """Return the end of its standard error; empty of a class."""


class InProcessPredictor:
    """A class of this process as a session."""

    def __init__(self, predictor: BoxPredictor, name: str, who: str) -> None:
        """Call its method; `who` names it in messages."""
        self._predictor, self._who, self.name = predictor, who, name
        self.shape: Shape = getattr(predictor, "shape", ANY_SHAPE)

    def query(self, box: MapBox) -> Answer:
        """Return its prediction of a box."""
        with predictor_code(self._who):
            answer = self._predictor.predict(box)
        try:
            return Answer(in_steps(answer, box))
        except PredictionError as error:
            raise PredictorError(self._who, f"predicted what is none: {error}") from None

    def close(self) -> None:
        """Do nothing: a class needs no end."""

    def stderr(self) -> str:
        """Return nothing: it shares this process's."""
        return ""


class RemotePredictor(Peer):
    """A predictor behind a connection."""

    role = "predictor"
    shape: Shape = ANY_SHAPE

    def __init__(self, connection: Connection, who: str, wall_s: float) -> None:
        """Say hello; see `Peer`."""
        super().__init__(connection, who, wall_s)
        self.name = _name(self.name)

    def failed(self, what: str, way: Way = "broken", traceback: str = "") -> PredictorError:
        """Return an error that says in one line what the predictor did."""
        return PredictorError(self._who, what, PREDICTOR_CAUSES[way], traceback)

    def query(self, box: MapBox) -> Answer:
        """Return its prediction of a box."""
        self._send(sb.ToStack(map_box=box_message(box)))
        message = self._receive("prediction", self._wall_s).prediction
        if message.sequence != box.sequence:
            raise self.failed(f"answered box {message.sequence}, expected {box.sequence}")
        try:
            return read_answer(message, box)
        except PredictionError as error:
            raise self.failed(f"predicted what is none: {error}") from None


def connect_predictor(source: str, wall_s: float) -> PredictorSession:
    """Connect to a predictor from outside.

    Args:
        source: `module:Class`, `path/to/file.py:Class`, `FILE.onnx`, `exec:COMMAND`, `unix:PATH`
            or `tcp:HOST:PORT`.
        wall_s: Wall time for each answer of another process, s.

    Raises:
        InputError: There is no such predictor, or it does not answer.
    """
    who = f"predictor '{source}'"
    if source.startswith(EXEC):
        child = ChildProcess(source.removeprefix(EXEC), SETTING)
        return RemotePredictor(child, who, wall_s)
    if source.startswith(SOCKETS):
        return RemotePredictor(Socket(source, wall_s, SETTING, "predictor"), who, wall_s)
    return InProcessPredictor(*in_process(source), who)


def in_process(source: str) -> tuple[BoxPredictor, str]:
    """Return a predictor that runs in this process, and its name.

    Raises:
        InputError: There is none, or it cannot be made.
    """
    predictor = make_predictor(source)
    return predictor, _name(str(getattr(predictor, "name", "")) or source.rpartition(":")[2])


def make_predictor(source: str) -> BoxPredictor:
    """Return a network of a file, or an instance of a class of the user's own.

    Raises:
        InputError: There is none, or it cannot be made.
    """
    if source.endswith(ONNX_FILE):
        from wayproof.harness.interface.predictors.onnx_predictor import OnnxPredictor

        return OnnxPredictor(Path(source))
    try:
        kind = load_class(source)
    except ValueError as error:
        raise InputError(f"{SETTING}: got '{source}', which cannot be loaded: {error}") from None
    if not callable(getattr(kind, "predict", None)):
        raise InputError(
            f"{SETTING}: got '{source}', a class without predict; expected one with predict(box)"
        )
    try:
        with user_code(f"predictor '{source}'"):
            predictor: BoxPredictor = kind()
    except UserCodeError as error:
        raise InputError(f"{SETTING}: {error}") from None
    return predictor


def runs_in_process(source: str) -> bool:
    """Return whether a predictor from outside runs in this process."""
    return not source.startswith((EXEC, *SOCKETS))


def predictor_digest(source: str) -> str:
    """Return the SHA-256, in hex, of the file of a predictor in this process; empty if none."""
    if not source.endswith(ONNX_FILE):
        return source_digest(source)
    file = Path(source)
    return hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else ""


def predictor_code(who: str) -> contextlib.AbstractContextManager[None]:
    """Run a predictor's code; any exception becomes a `PredictorError`.

    Raises:
        PredictorError: With the exception as its cause.
    """

    def failure(what: str, way: Way) -> PredictorError:
        return PredictorError(who, what, PREDICTOR_CAUSES[way])

    return code_from_outside(who, failure)


def box_message(box: MapBox) -> sb.MapBox:
    """Return a box as another process gets it."""
    x, y, z = box.origin.tolist()
    a, b, c = box.position.tolist()
    return sb.MapBox(
        time_ns=box.time_ns,
        sequence=box.sequence,
        resolution=box.resolution,
        origin=sb.Vector(x=x, y=y, z=z),
        shape=box.states.shape,
        states=box.states.tobytes(),
        position=sb.Vector(x=a, y=b, z=c),
        quaternion=box.quaternion.tolist(),
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


def _name(text: str) -> str:
    return printable(text)[:MOST_NAME]
