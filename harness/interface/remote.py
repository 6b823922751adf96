"""A stack in another process: length-prefixed protobuf on its pipes or on a socket, in lockstep."""

from __future__ import annotations

import collections
import contextlib
import ctypes
import fcntl
import os
import select
import shlex
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from abc import ABC, abstractmethod
from typing import IO

from google.protobuf.message import DecodeError

from wayproof.harness.errors import InputError, printable
from wayproof.harness.interface.command_messages import CommandError, check_command
from wayproof.harness.interface.errors import StackError
from wayproof.harness.interface.observation_messages import (
    hello,
    observation_message,
    task_message,
)
from wayproof.harness.interface.types import INTERFACE_VERSION, Observation, Task
from wayproof.harness.schema import stack_pb2 as sb

MAX_MESSAGE = 64 * 2**20
"""Longest message that is read, bytes."""

STDERR_KEPT = 64 * 2**10
"""Part of a stack's standard error that is kept: its end, bytes."""

STARTING_S = 60.0
"""Wall time that a stack gets at least to start and say hello, s."""

CLOSING_S = 2.0
"""Wall time that a stack gets to end by itself when it is closed, s."""

READ_AT_ONCE = 2**16

POLLED_S = 5e-4
"""Time for which an answer is polled for before this process sleeps, s: to wake a core of a virtual
machine takes longer than a simple stack takes to answer."""

PIPE_BYTES = 2**20
"""Capacity of the pipe to a child: Linux's greatest without privileges."""

PR_SET_PDEATHSIG = 1


class Connection(ABC):
    """Both directions of the pipe or socket to a stack."""

    @abstractmethod
    def send(self, data: bytes, until: float) -> None:
        """Send all of it before a time of `time.monotonic`."""

    @abstractmethod
    def receive(self, count: int, until: float) -> bytes:
        """Receive exactly so many bytes before that time."""

    @abstractmethod
    def close(self) -> None:
        """End the connection, and the process behind it if it is a child."""

    def ending(self) -> str:
        """How the other side ended, in words; empty if nothing is known."""
        return ""

    def stderr(self) -> str:
        """The end of the stack's standard error."""
        return ""


class TooLate(Exception):
    """Nothing came, or nothing was taken, in time."""


class Ended(Exception):
    """The other side has closed the connection."""


class FileDescriptors(Connection):
    """A connection over two file descriptors, which may be one and the same."""

    def __init__(self, read: int, write: int) -> None:
        """Use open descriptors; they are made non-blocking."""
        self._read, self._write = read, write
        self._received = bytearray()
        for descriptor in {read, write}:
            os.set_blocking(descriptor, False)

    def send(self, data: bytes, until: float) -> None:
        """Send all of it before a time of `time.monotonic`."""
        left = memoryview(data)
        while left:
            try:
                left = left[os.write(self._write, left) :]
            except BlockingIOError:
                _wait_for([], [self._write], until)
            except OSError:
                raise Ended from None

    def receive(self, count: int, until: float) -> bytes:
        """Receive exactly so many bytes before that time."""
        polled_until = time.monotonic() + POLLED_S
        while len(self._received) < count:
            try:
                part = os.read(self._read, READ_AT_ONCE)
            except BlockingIOError:
                if time.monotonic() < polled_until:
                    os.sched_yield()  # the stack may be waiting for this very core
                else:
                    _wait_for([self._read], [], until)
                continue
            except OSError:
                raise Ended from None
            if not part:
                raise Ended
            self._received += part
        data = bytes(self._received[:count])
        del self._received[:count]
        return data

    def close(self) -> None:
        """Close both."""
        for descriptor in {self._read, self._write}:
            with contextlib.suppress(OSError):
                os.close(descriptor)


def _wait_for(readable: list[int], writable: list[int], until: float) -> None:
    left = until - time.monotonic()
    if left <= 0.0 or not any(select.select(readable, writable, [], left)):
        raise TooLate


class ChildProcess(FileDescriptors):
    """A command as a child: its standard input and output; nothing of it outlives the episode."""

    def __init__(self, command: str) -> None:
        """Start it in a session of its own.

        Raises:
            InputError: There is no such command.
        """
        try:
            words = shlex.split(command)
        except ValueError as error:
            raise InputError(f"--stack exec:{command}: {error}") from None
        if not words:
            raise InputError("--stack exec: got no command, expected exec:COMMAND")
        try:
            self._child = subprocess.Popen(
                words,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                start_new_session=True,
                preexec_fn=_die_with_parent if sys.platform == "linux" else None,
            )
        except OSError as error:
            raise InputError(f"--stack exec:{command}: {words[0]}: {error.strerror}") from None
        assert self._child.stdin is not None
        assert self._child.stdout is not None
        assert self._child.stderr is not None
        _widen(self._child.stdin.fileno())
        # Descriptors of our own: those of the process object close with it.
        super().__init__(os.dup(self._child.stdout.fileno()), os.dup(self._child.stdin.fileno()))
        self._child.stdin.close()
        self._child.stdout.close()
        self._stderr: collections.deque[bytes] = collections.deque()
        self._drain = threading.Thread(target=self._keep_end, args=(self._child.stderr,))
        self._drain.daemon = True
        self._drain.start()

    def _keep_end(self, stream: IO[bytes]) -> None:
        size = 0
        with stream:
            while part := os.read(stream.fileno(), 2**14):
                self._stderr.append(part)
                size += len(part)
                while size - len(self._stderr[0]) > STDERR_KEPT:
                    size -= len(self._stderr.popleft())

    def close(self) -> None:
        """Close the pipes, wait a moment, then kill the whole session."""
        super().close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._child.wait(CLOSING_S)
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._child.pid, signal.SIGKILL)
        self._child.wait()
        self._drain.join(CLOSING_S)

    def ending(self) -> str:
        """Its exit code or signal, once it has ended."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            code = self._child.wait(CLOSING_S)
            return f"exit code {code}" if code >= 0 else f"signal {signal.Signals(-code).name}"
        return "closed its output, and still runs"

    def stderr(self) -> str:
        """The end of its standard error."""
        return b"".join(self._stderr).decode(errors="replace")


def _widen(pipe: int) -> None:
    """Have a pipe hold a whole observation, so that it is written at once."""
    if sys.platform == "linux":
        with contextlib.suppress(OSError):  # an unprivileged user's pipes are limited
            fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, PIPE_BYTES)


def _die_with_parent() -> None:
    """In the child, before the command: be killed when the harness is gone."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


class Socket(FileDescriptors):
    """A stack that listens on a socket, such as one in a container."""

    def __init__(self, address: str, wall_s: float) -> None:
        """Connect to `unix:PATH` or `tcp:HOST:PORT`.

        Raises:
            InputError: Nobody listens there, or it is no address.
        """
        try:
            self._socket = _connected(address, wall_s)
        except ValueError:
            raise InputError(f"--stack {address}: expected tcp:HOST:PORT") from None
        except OSError as error:
            why = error.strerror or str(error)
            raise InputError(f"--stack {address}: {why}, expected a stack that listens") from None
        super().__init__(self._socket.fileno(), self._socket.fileno())

    def close(self) -> None:
        """Close it."""
        self._socket.close()


def _connected(address: str, wall_s: float) -> socket.socket:
    kind, _, place = address.partition(":")
    if kind == "unix":
        connected = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        try:
            connected.settimeout(wall_s)
            connected.connect(place)
        except OSError:
            connected.close()
            raise
        return connected
    host, _, port = place.rpartition(":")
    connected = socket.create_connection((host, int(port)), wall_s)
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return connected


class RemoteStack:
    """A stack behind a connection.

    Attributes:
        name: Of the stack, as it calls itself; empty before it has started.
    """

    def __init__(self, connection: Connection, who: str, wall_s: float) -> None:
        """Say hello.

        Args:
            connection: To it.
            who: What it is called in messages, such as `stack 'exec:./mine'`.
            wall_s: Wall time for each answer, s.

        Raises:
            InputError: It does not speak this version of the interface.
        """
        self._connection, self._who, self._wall_s = connection, who, wall_s
        self._task: Task | None = None
        try:
            self._send(sb.ToStack(hello=hello("wayproof")))
            answer = self._receive("hello", max(wall_s, STARTING_S))
        except StackError as error:
            connection.close()
            raise InputError(str(error)) from None
        if answer.hello.version != INTERFACE_VERSION:
            connection.close()
            raise InputError(
                f"{who} speaks version {answer.hello.version} of the stack interface, expected "
                f"{INTERFACE_VERSION}"
            )
        self.name = printable(answer.hello.name)[:200]
        self._announced = answer.hello.announced

    def start(self, task: Task) -> None:
        """Send the task."""
        self._task = task
        self._send(sb.ToStack(task=task_message(task)))

    def announce(self) -> None:
        """Wake a stack that wishes it, while its observation is made: to wake takes longer."""
        if self._announced:
            self._send(sb.ToStack())

    def ask(self, observation: Observation) -> sb.Command:
        """The command that answers an observation.

        Raises:
            StackError: None came in time, or what came is none.
        """
        assert self._task is not None
        self._send(sb.ToStack(observation=observation_message(observation, self._task)))
        command = self._receive("command", self._wall_s).command
        if command.sequence != observation.sequence:
            raise StackError(
                self._who,
                f"answered observation {command.sequence}, expected {observation.sequence}",
            )
        try:
            check_command(command)
        except CommandError as error:
            raise StackError(self._who, f"sent a command with {error}") from None
        return command

    def close(self) -> None:
        """Tell it to end, and see to it."""
        with contextlib.suppress(StackError):
            self._send(sb.ToStack(close=sb.Close()), within_s=CLOSING_S)
        self._connection.close()

    def stderr(self) -> str:
        """The end of its standard error, where it is a child."""
        return self._connection.stderr()

    def _send(self, message: sb.ToStack, within_s: float | None = None) -> None:
        data = message.SerializeToString(deterministic=True)
        wall_s = self._wall_s if within_s is None else within_s
        until = time.monotonic() + wall_s
        try:
            self._connection.send(struct.pack("<I", len(data)) + data, until)
        except TooLate:
            raise StackError(
                self._who,
                f"had not read its input after {wall_s:g} s (plugins.wall_s)",
                "stack_hung",
            ) from None
        except Ended:
            raise self._ended() from None

    def _receive(self, kind: str, wall_s: float) -> sb.FromStack:
        """The next message, of a kind.

        Raises:
            StackError: It is none, or of another kind.
        """
        until = time.monotonic() + wall_s
        try:
            (length,) = struct.unpack("<I", self._connection.receive(4, until))
            if not 0 < length <= MAX_MESSAGE:
                raise StackError(
                    self._who,
                    f"sent a message of {length} bytes, expected 1 to {MAX_MESSAGE}: its output "
                    "is for messages of the stack interface alone",
                )
            message = sb.FromStack.FromString(self._connection.receive(length, until))
        except TooLate:
            raise StackError(
                self._who,
                f"had not answered after {wall_s:g} s (plugins.wall_s)",
                "stack_hung",
            ) from None
        except Ended:
            raise self._ended() from None
        except DecodeError:
            raise StackError(
                self._who, f"sent {length} bytes that are no message of the stack interface"
            ) from None
        got = message.WhichOneof("kind")
        if got == "failure":
            text = printable(message.failure.text)[:300]
            traceback = message.failure.traceback
            raise StackError(self._who, f"failed: {text}", traceback=traceback)
        if got != kind:
            raise StackError(self._who, f"sent {got or 'an empty message'}, expected {kind}")
        return message

    def _ended(self) -> StackError:
        ending = self._connection.ending()
        lines = [line for line in self.stderr().splitlines() if line.strip()]
        last = f"; its last line on stderr: {printable(lines[-1])[:200]}" if lines else ""
        how = ending or "connection closed"
        return StackError(self._who, f"ended ({how}){last}", "stack_died")
