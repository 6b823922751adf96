"""A stack or predictor in another process: protobuf, each message after its length, in lockstep."""

from __future__ import annotations

import contextlib
import struct
import time
from typing import ClassVar

from google.protobuf.message import DecodeError

from wayproof.harness.errors import InputError, printable
from wayproof.harness.interface.box_messages import Answer, box_message, read_answer
from wayproof.harness.interface.command_messages import CommandError, check_command
from wayproof.harness.interface.connection import CLOSING_S, Connection, Ended, TooLate
from wayproof.harness.interface.errors import OutsideError, PredictorError, StackError
from wayproof.harness.interface.observation_messages import (
    hello,
    observation_message,
    task_message,
)
from wayproof.harness.interface.types import INTERFACE_VERSION, Observation, Task
from wayproof.harness.prediction.predicted_box import PredictionError
from wayproof.harness.prediction.predictor import ANY_SHAPE, MapBox
from wayproof.harness.schema import stack_pb2 as sb

MAX_MESSAGE = 64 * 2**20
"""Longest message that is read, bytes."""

MOST_NAME = 80
"""Most characters of a name that the log keeps."""

STARTING_S = 60.0
"""Wall time that a stack gets at least to start and say hello, s."""


class Peer:
    """Another process that answers messages in lockstep: a stack, or a predictor.

    Attributes:
        name: As it calls itself.
    """

    error: ClassVar[type[OutsideError]]
    """Error of a failure."""

    role = ""
    """Role in the hello of both sides; empty of a stack."""

    def __init__(self, connection: Connection, who: str, wall_s: float) -> None:
        """Say hello.

        Args:
            connection: Connection to it.
            who: Its name in messages, such as `stack 'exec:./mine'`.
            wall_s: Wall time for each answer, s.

        Raises:
            InputError: It does not speak this version of the interface, or has another role.
        """
        self._connection, self._who, self._wall_s = connection, who, wall_s
        try:
            self._send(sb.ToStack(hello=hello("wayproof", role=self.role)))
            answer = self._receive("hello", max(wall_s, STARTING_S))
        except OutsideError as error:
            connection.close()
            raise InputError(str(error)) from None
        if answer.hello.version != INTERFACE_VERSION:
            connection.close()
            raise InputError(
                f"{who} speaks version {answer.hello.version} of the stack interface, expected "
                f"{INTERFACE_VERSION}"
            )
        if answer.hello.role != self.role:
            connection.close()
            got = printable(answer.hello.role)[:40] or "stack"
            raise InputError(f"{who} is a {got}, expected a {self.role or 'stack'}")
        self.name = printable(answer.hello.name)[:MOST_NAME]
        self._announced = answer.hello.announced

    def failed(self, what: str, traceback: str = "") -> OutsideError:
        """Return an error that says in one line what the other side did."""
        return self.error(self._who, what, traceback)

    def close(self) -> None:
        """Send the end, and end the process if it still runs."""
        with contextlib.suppress(OutsideError):
            self._send(sb.ToStack(close=sb.Close()), within_s=CLOSING_S)
        self._connection.close()

    def stderr(self) -> str:
        """Return the end of its standard error, where it is a child."""
        return self._connection.stderr()

    def _send(self, message: sb.ToStack, within_s: float | None = None) -> None:
        data = message.SerializeToString(deterministic=True)
        wall_s = self._wall_s if within_s is None else within_s
        until = time.monotonic() + wall_s
        try:
            self._connection.send(struct.pack("<I", len(data)) + data, until)
        except TooLate:
            raise self.failed(
                f"had not read its input after {wall_s:g} s (plugins.wall_s)"
            ) from None
        except Ended:
            raise self._ended() from None

    def _receive(self, kind: str, wall_s: float) -> sb.FromStack:
        """Return the next message, of a kind.

        Raises:
            OutsideError: It is none, or of another kind.
        """
        until = time.monotonic() + wall_s
        try:
            (length,) = struct.unpack("<I", self._connection.receive(4, until))
            if not 0 < length <= MAX_MESSAGE:
                raise self.failed(
                    f"sent a message of {length} bytes, expected 1 to {MAX_MESSAGE}: its output "
                    "is for messages of the stack interface alone"
                )
            message = sb.FromStack.FromString(self._connection.receive(length, until))
        except TooLate:
            raise self.failed(f"had not answered after {wall_s:g} s (plugins.wall_s)") from None
        except Ended:
            raise self._ended() from None
        except DecodeError:
            raise self.failed(
                f"sent {length} bytes that are no message of the stack interface"
            ) from None
        got = message.WhichOneof("kind")
        if got == "failure":
            text = printable(message.failure.text)[:300]
            traceback = message.failure.traceback
            raise self.failed(f"failed: {text}", traceback=traceback)
        if got != kind:
            raise self.failed(f"sent {got or 'an empty message'}, expected {kind}")
        return message

    def _ended(self) -> OutsideError:
        ending = self._connection.ending()
        lines = [line for line in self.stderr().splitlines() if line.strip()]
        last = f"; its last line on stderr: {printable(lines[-1])[:200]}" if lines else ""
        how = ending or "connection closed"
        return self.failed(f"ended ({how}){last}")


class RemoteStack(Peer):
    """A stack behind a connection."""

    error = StackError

    def start(self, task: Task) -> None:
        """Send the task."""
        self._task = task
        self._send(sb.ToStack(task=task_message(task)))

    def announce(self) -> None:
        """Wake a stack that wishes it, while its observation is made: to wake takes longer."""
        if self._announced:
            self._send(sb.ToStack())

    def query(self, observation: Observation) -> sb.Command:
        """Return the command that answers an observation.

        Raises:
            StackError: None came in time, or what came is none.
        """
        self._send(sb.ToStack(observation=observation_message(observation, self._task)))
        command = self._receive("command", self._wall_s).command
        if command.sequence != observation.sequence:
            raise self.failed(
                f"answered observation {command.sequence}, expected {observation.sequence}"
            )
        try:
            check_command(command)
        except CommandError as error:
            raise self.failed(f"sent a command with {error}") from None
        return command


class RemotePredictor(Peer):
    """A predictor behind a connection."""

    error = PredictorError
    role = "predictor"
    shape = ANY_SHAPE

    def query(self, box: MapBox) -> Answer:
        """Return its prediction of a box.

        Raises:
            PredictorError: None came in time, or what came is none.
        """
        self._send(sb.ToStack(map_box=box_message(box)))
        message = self._receive("prediction", self._wall_s).prediction
        if message.sequence != box.sequence:
            raise self.failed(f"answered box {message.sequence}, expected {box.sequence}")
        try:
            return read_answer(message, box)
        except PredictionError as error:
            raise self.failed(f"predicted what is none: {error}") from None
