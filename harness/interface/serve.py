"""Serve a stack or a predictor of Python to a harness in another process.

It is the other end of `exec:` and of sockets.
"""

from __future__ import annotations

import os
import socket
import struct
import sys
import traceback
from dataclasses import fields, replace
from functools import partial
from typing import IO, Protocol

import numpy as np

from wayproof.harness.errors import InputError, printable
from wayproof.harness.input_messages import covariance_of, unheld_of
from wayproof.harness.inputs import Pose, SweepInput, WorldSweep
from wayproof.harness.interface.box_messages import box_from
from wayproof.harness.interface.command_messages import CommandError, command_message
from wayproof.harness.interface.connect import (
    PREDICTOR_SETTING,
    make_predictor,
    make_stack,
    runs_elsewhere,
)
from wayproof.harness.interface.connection import host_and_port
from wayproof.harness.interface.incoming import MESSAGE_S, Incoming, NotHarness
from wayproof.harness.interface.message_values import values_of
from wayproof.harness.interface.observation_messages import (
    fate_from,
    hello,
    reference_from,
    sweep_inputs,
    task_from,
    trail_from,
)
from wayproof.harness.interface.observations import read_only
from wayproof.harness.interface.types import Observation, Sensor, Stack, Sweep, Task
from wayproof.harness.prediction.predicted_box import PredictionError, in_steps
from wayproof.harness.schema import stack_pb2 as sb

HELLO_S = 10.0
"""Wall time within which whoever connects says hello, s."""

IDLE_S = 900.0
"""Wall time between two messages on a socket, s: a harness compiles and simulates in between."""


def serve(name: str, predictor: bool = False) -> None:
    """Serve a stack on standard input and output; its prints go to standard error.

    Args:
        name: As `--stack` takes it, or as `prediction.source` does.
        predictor: Whether it is a predictor.
    """
    made = _served(name, predictor)  # an unknown one is refused before the pipes are taken
    read = os.dup(0)
    with os.fdopen(os.dup(1), "wb", buffering=2**20) as write:
        os.dup2(2, 1)
        sys.stdout = sys.stderr
        answer_all(made, read, write)


def listen(name: str, address: str, predictor: bool = False) -> None:
    """Serve a stack to one harness after the other, on `unix:PATH` or `tcp:HOST:PORT`.

    Args:
        name: As `--stack` takes it, or as `prediction.source` does.
        address: Address to listen on.
        predictor: Whether it is a predictor.

    Raises:
        InputError: The address cannot be listened on.
    """
    _served(name, predictor)  # refused before anything listens
    with _listening(address) as server:
        while True:
            connection, _ = server.accept()
            try:
                with connection:
                    _answer_connection(_served(name, predictor), connection)
            except (InputError, OSError) as error:
                print(f"wayproof: connection ended: {error}", file=sys.stderr)
            except Exception:  # of the stack as it is closed: the next harness gets one of its own
                traceback.print_exc()


def _answer_connection(served: Served, connection: socket.socket) -> None:
    """Answer one harness; see `answer_all`."""
    if connection.family != socket.AF_UNIX:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.settimeout(MESSAGE_S)
    with connection.makefile("wb") as write:
        answer_all(served, connection.fileno(), write, HELLO_S, IDLE_S)


def _listening(address: str) -> socket.socket:
    kind, _, place = address.partition(":")
    try:
        if kind == "unix":
            server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            server.bind(place)
        elif kind == "tcp":
            server = socket.create_server(host_and_port(place))
        else:
            raise ValueError
        server.listen()
    except ValueError:
        raise InputError(f"--listen {address}: expected unix:PATH or tcp:HOST:PORT") from None
    except OSError as error:
        raise InputError(f"--listen {address}: {error.strerror or error}") from None
    return server


class Served(Protocol):
    """A stack or a predictor behind the messages of the harness."""

    def answer(self, message: sb.ToStack) -> sb.FromStack | None:
        """Return the answer to a message; None to one that has none.

        Raises:
            CommandError: What it returned is no command.
            PredictionError: What it returned is no prediction.
        """

    def rehearse(self) -> None:
        """Get ready for a message that was announced."""

    def close(self) -> None:
        """End it."""


def answer_all(
    served: Served,
    read: int,
    write: IO[bytes],
    hello_s: float | None = None,
    idle_s: float | None = None,
) -> None:
    """Answer the harness until it closes the connection, or the stack or predictor fails.

    Args:
        served: Stack or predictor that answers.
        read: Descriptor of the harness's messages.
        write: Answers.
        hello_s: Wall time for the first message, s; None for any.
        idle_s: Wall time from one message to the next, s; None for any.

    Raises:
        NotHarness: What came is no message, too long, too late, or begins without a hello.
    """
    incoming = Incoming(read)
    try:
        message = incoming.next(hello_s)
        if message is not None and message.WhichOneof("kind") != "hello":
            raise NotHarness(f"got {message.WhichOneof('kind')}, expected hello")
        while message is not None:
            answer, fails = _answer(served, message)
            if answer is not None:
                _send(write, answer)
            if fails or message.WhichOneof("kind") == "close":
                break
            message = incoming.next(idle_s, served.rehearse)
    finally:
        served.close()


def _answer(served: Served, message: sb.ToStack) -> tuple[sb.FromStack | None, bool]:
    """Return the answer to a message, and whether it is a failure."""
    try:
        return served.answer(message), False
    except CommandError as error:
        failure = sb.Failure(text=f"returned no valid command: {error}"[:300])
    except PredictionError as error:
        failure = sb.Failure(text=f"predicted what is none: {error}"[:300])
    except NotHarness:
        raise
    except Exception as error:
        text = printable(f"{type(error).__name__}: {' '.join(str(error).split())}")[:300]
        failure = sb.Failure(text=text, traceback=traceback.format_exc()[-16_000:])
        traceback.print_exc()
    return sb.FromStack(failure=failure), True


def _served(name: str, predictor: bool) -> Served:
    return ServedPredictor(name) if predictor else ServedStack(make_stack(name), name)


class ServedPredictor:
    """A predictor behind the messages of the harness."""

    def __init__(self, source: str) -> None:
        """Make it, as `prediction.source` takes it.

        Raises:
            InputError: There is none.
        """
        if runs_elsewhere(source):
            raise InputError(
                f"{PREDICTOR_SETTING}: got '{source}', expected module:Class or FILE.onnx"
            )
        self._predictor, self._name = make_predictor(source)

    def answer(self, message: sb.ToStack) -> sb.FromStack | None:
        """Return the answer to a hello or a box; None to anything else.

        Raises:
            PredictionError: What it returned is no prediction.
        """
        kind = message.WhichOneof("kind")
        if kind == "hello":
            return sb.FromStack(hello=hello(self._name, role="predictor"))
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


class ServedStack:
    """A stack behind the messages of the harness."""

    def __init__(self, stack: Stack, name: str) -> None:
        """Serve a stack under a name."""
        self._stack, self._name = stack, name
        self._task: Task | None = None
        self._observed: sb.Observation | None = None

    def answer(self, message: sb.ToStack) -> sb.FromStack | None:
        """Return the answer to a message; None to one that has none.

        Raises:
            CommandError: What the stack returned is no command.
        """
        kind = message.WhichOneof("kind")
        if kind == "hello":
            return sb.FromStack(hello=hello(self._name, announced=True))
        if kind == "task":
            self._task = task_from(message.task)
            self._stack.start(self._task)
        elif kind == "observation":
            return sb.FromStack(command=self._step(message.observation))
        return None

    def close(self) -> None:
        """End the stack."""
        self._stack.close()

    def rehearse(self) -> None:
        """Decode the last observation again: the next is on its way, and finds all in the caches.

        Its decoding took 0.13 ms of a step, and takes 0.05 after this.
        """
        if self._observed is not None and self._task is not None:
            observation_from(self._observed, self._task)

    def _step(self, message: sb.Observation) -> sb.Command:
        if self._task is None:
            raise NotHarness("got an observation, expected the task before it")
        self._observed = message
        command = self._stack.step(observation_from(message, self._task))
        return command_message(command, message.sequence)


def observation_from(message: sb.Observation, task: Task) -> Observation:
    """Decode an observation, in the stack's process."""
    values = values_of(message, Observation)
    for name in ("position", "quaternion", "velocity", "goal"):
        values[name] = np.array(values[name])
    values |= {"covariance": covariance_of(message), "unheld": unheld_of(message)}
    pose = Pose(
        **{one.name: values[one.name] for one in fields(Pose) if one.name in values},
        trail=trail_from(message),
    )
    sweeps = tuple(
        Sweep(
            sweep.sensor,
            sweep.ranges_mm,
            sweep.classes,
            partial(_placed, task.sensors[sweep.sensor], sweep, pose, message.sequence),
            sweep.age_ns,
            sweep.lag,
        )
        for sweep in sweep_inputs(message)
    )
    values |= {name: read_only(values[name]) for name in ("position", "quaternion")}
    return Observation(
        **values,
        sweeps=sweeps,
        reference=reference_from(message),
        last=fate_from(message),
        trail=pose.trail,
    )


def _placed(sensor: Sensor, sweep: SweepInput, pose: Pose, sequence: int) -> WorldSweep:
    """Place a sweep in the world frame, with writable ranges, which kernels are compiled for."""
    own = replace(sweep, ranges_mm=sweep.ranges_mm.copy())
    return sensor.beams.place(own, pose, sequence)


def _send(write: IO[bytes], message: sb.FromStack) -> None:
    data = message.SerializeToString(deterministic=True)
    write.write(struct.pack("<I", len(data)) + data)
    write.flush()
