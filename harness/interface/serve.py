"""Serve a stack or a predictor of Python to a harness in another process.

It is the other end of `exec:` and of sockets.
"""

from __future__ import annotations

import contextlib
import os
import select
import socket
import struct
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from io import RawIOBase
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

POLLED_S = 2e-3
"""Time for which an announced observation is polled for, s: the harness makes it in a tenth."""


def serve(name: str, predictor: bool = False) -> None:
    """Serve a stack on standard input and output; its prints go to standard error.

    Args:
        name: As `--stack` takes it, or as `prediction.source` does.
        predictor: Whether it is a predictor.
    """
    made = _served(name, predictor)  # an unknown one is refused before the pipes are taken
    read = os.fdopen(os.dup(0), "rb", buffering=0)
    write = os.fdopen(os.dup(1), "wb", buffering=2**20)
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
            with connection:
                if connection.family != socket.AF_UNIX:
                    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                read, write = connection.makefile("rb", buffering=0), connection.makefile("wb")
                with contextlib.suppress(BrokenPipeError, ConnectionResetError), read, write:
                    answer_all(_served(name, predictor), read, write)


def _listening(address: str) -> socket.socket:
    kind, _, place = address.partition(":")
    try:
        if kind == "unix":
            server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            server.bind(place)
        elif kind == "tcp":
            host, _, port = place.rpartition(":")
            server = socket.create_server((host, int(port)))
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


def answer_all(served: Served, read: RawIOBase, write: IO[bytes]) -> None:
    """Answer the harness until it closes the connection, or the stack or predictor fails.

    Args:
        served: Stack or predictor that answers.
        read: Messages of the harness.
        write: Answers.
    """
    while (message := _receive(read, served.rehearse)) is not None:
        answer, fails = _answer(served, message)
        if answer is not None:
            _send(write, answer)
        if fails or message.WhichOneof("kind") == "close":
            break
    served.close()


def _answer(served: Served, message: sb.ToStack) -> tuple[sb.FromStack | None, bool]:
    """Return the answer to a message, and whether it is a failure."""
    try:
        return served.answer(message), False
    except CommandError as error:
        failure = sb.Failure(text=f"returned no valid command: {error}"[:300])
    except PredictionError as error:
        failure = sb.Failure(text=f"predicted what is none: {error}"[:300])
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
        assert self._task is not None
        self._observed = message
        command = self._stack.step(observation_from(message, self._task))
        return command_message(command, message.sequence)


def observation_from(message: sb.Observation, task: Task) -> Observation:
    """Decode an observation, in the stack's process."""
    position = message.position
    pose = Pose(
        position=np.array([position.x, position.y, position.z]),
        quaternion=np.array(message.quaternion[:]),
        position_sigma=message.position_sigma,
        trail=trail_from(message),
        heading_sigma=message.heading_sigma,
        covariance=covariance_of(message),
        unheld=unheld_of(message),
    )
    velocity, sequence = message.velocity, message.sequence
    sweeps = tuple(
        Sweep(
            sweep.sensor,
            sweep.ranges_mm,
            sweep.classes,
            partial(_placed, task.sensors[sweep.sensor], sweep, pose, sequence),
        )
        for sweep in sweep_inputs(message)
    )
    return Observation(
        time_ns=message.time_ns,
        sequence=sequence,
        position=read_only(pose.position),
        quaternion=read_only(pose.quaternion),
        position_sigma=pose.position_sigma,
        heading_sigma=pose.heading_sigma,
        velocity=np.array([velocity.x, velocity.y, velocity.z]),
        yaw_rate=message.yaw_rate,
        sweeps=sweeps,
        effect_ns=message.effect_ns,
        reference=reference_from(message),
        last=fate_from(message),
        trail=pose.trail,
        covariance=pose.covariance,
        unheld=pose.unheld,
        goal=np.array([message.goal.x, message.goal.y, message.goal.z]),
        goals_reached=message.goals_reached,
    )


def _placed(sensor: Sensor, sweep: SweepInput, pose: Pose, sequence: int) -> WorldSweep:
    """Place a sweep in the world frame, with writable ranges, which kernels are compiled for."""
    own = replace(sweep, ranges_mm=sweep.ranges_mm.copy())
    return sensor.beams.place(own, pose, sequence)


def _receive(read: RawIOBase, rehearse: Callable[[], None]) -> sb.ToStack | None:
    """Read the next message; None at the end. Rehearse whenever an observation is announced."""
    while (head := _read_exactly(read, 4)) is not None:
        (length,) = struct.unpack("<I", head)
        if length:
            data = _read_exactly(read, length)
            return None if data is None else sb.ToStack.FromString(data)
        rehearse()
        _poll(read)
    return None


def _read_exactly(read: RawIOBase, count: int) -> bytes | None:
    """Read a number of bytes; None if the input ends before."""
    data = bytearray(count)
    left = memoryview(data)
    while left:
        got = read.readinto(left)
        if not got:
            return None
        left = left[got:]
    return bytes(data)


def _poll(read: RawIOBase) -> None:
    """Stay awake until an announced observation comes, or for `POLLED_S`."""
    until = time.monotonic() + POLLED_S
    poll = select.poll()
    poll.register(read.fileno(), select.POLLIN)
    while not poll.poll(0) and time.monotonic() < until:
        os.sched_yield()  # the harness may be waiting for this very core


def _send(write: IO[bytes], message: sb.FromStack) -> None:
    data = message.SerializeToString(deterministic=True)
    write.write(struct.pack("<I", len(data)) + data)
    write.flush()
