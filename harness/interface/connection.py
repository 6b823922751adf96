"""Connections to another process: the pipes of a child, or a socket."""

from __future__ import annotations

import collections
import contextlib
import errno
import fcntl
import os
import select
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import IO

from wayproof.harness.errors import InputError
from wayproof.harness.interface import keeper

STDERR_KEPT = 64 * 2**10
"""Part of a stack's standard error that is kept: its end, bytes."""

CLOSING_S = 2.0
"""Wall time that a stack gets to end by itself when it is closed, s."""

READ_AT_ONCE = 2**16

POLLED_S = 5e-4
"""Time for which an answer is polled for before this process sleeps, s: to wake a core of a virtual
machine takes longer than a simple stack takes to answer."""

LOOPBACK = "127.0.0.1"
"""Address that `tcp::PORT` means, which names none."""

PIPE_BYTES = 2**20
"""Capacity of the pipe to a child: Linux's greatest without privileges."""


class Connection(ABC):
    """Both directions of the pipe or socket to a stack."""

    @abstractmethod
    def send(self, data: bytes, until: float) -> None:
        """Send all bytes before a time of `time.monotonic`."""

    @abstractmethod
    def receive(self, count: int, until: float) -> bytes:
        """Receive a number of bytes before a time of `time.monotonic`."""

    @abstractmethod
    def close(self) -> None:
        """End the connection, and the process behind it if it is a child."""

    def ending(self) -> str:
        """Describe how the other side ended; empty if nothing is known."""
        return ""

    def stderr(self) -> str:
        """Return the end of the stack's standard error."""
        return ""


class TooLate(Exception):
    """No bytes were received or sent in time."""


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
        """Send all bytes before a time of `time.monotonic`."""
        left = memoryview(data)
        while left:
            try:
                left = left[os.write(self._write, left) :]
            except BlockingIOError:
                _wait_for([], [self._write], until)
            except OSError:
                raise Ended from None

    def receive(self, count: int, until: float) -> bytes:
        """Receive a number of bytes before a time of `time.monotonic`."""
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

    def __init__(
        self, command: str, given: str = "--stack", paths: Sequence[str] | None = None
    ) -> None:
        """Start it in a session of its own, on Linux by a `keeper`.

        Args:
            command: Its words, as a shell splits them.
            given: Option or setting that names it.
            paths: Folders of Python's modules in it; by default those of the environment.

        Raises:
            InputError: There is no such command.
        """
        try:
            words = shlex.split(command)
        except ValueError as error:
            raise InputError(f"{given} exec:{command}: {error}") from None
        if not words:
            raise InputError(f"{given} exec: got no command, expected exec:COMMAND")
        if shutil.which(words[0]) is None:
            why = os.strerror(errno.EACCES if os.path.exists(words[0]) else errno.ENOENT)
            raise InputError(f"{given} exec:{command}: {words[0]}: {why}")
        kept = [sys.executable, "-I", "-S", keeper.__file__, str(os.getpid())]
        self._child = subprocess.Popen(
            [*kept, *words] if sys.platform == "linux" else words,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
            env=None if paths is None else {**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        )
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
        """Close the pipes, wait a moment, then end it and all that it started."""
        super().close()
        try:
            self._child.wait(CLOSING_S)
        except subprocess.TimeoutExpired:
            self._child.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._child.wait(CLOSING_S)
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._child.pid, signal.SIGKILL)
        self._child.wait()
        self._drain.join(CLOSING_S)

    def ending(self) -> str:
        """Return its exit code or signal, once it has ended."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            code = self._child.wait(CLOSING_S)
            self._drain.join(CLOSING_S)  # its last words may still be in the pipe
            return f"exit code {code}" if code >= 0 else f"signal {signal.Signals(-code).name}"
        return "closed its output, and still runs"

    def stderr(self) -> str:
        """Return the end of its standard error."""
        return b"".join(self._stderr).decode(errors="replace")


def _widen(pipe: int) -> None:
    """Have a pipe hold a whole observation, so that it is written at once."""
    if sys.platform == "linux":
        with contextlib.suppress(OSError):  # an unprivileged user's pipes are limited
            fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, PIPE_BYTES)


class Socket(FileDescriptors):
    """A stack that listens on a socket, such as one in a container."""

    def __init__(
        self, address: str, wall_s: float, given: str = "--stack", who: str = "stack"
    ) -> None:
        """Connect to `unix:PATH` or `tcp:HOST:PORT`.

        Args:
            address: The address.
            wall_s: Wall time to connect in, s.
            given: Option or setting that names it.
            who: Name of the listener, for messages.

        Raises:
            InputError: Nobody listens there, or it is no address.
        """
        try:
            self._socket = _connected(address, wall_s)
        except ValueError:
            raise InputError(f"{given} {address}: expected tcp:HOST:PORT") from None
        except OSError as error:
            why = error.strerror or str(error)
            raise InputError(f"{given} {address}: {why}, expected a {who} that listens") from None
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
    connected = socket.create_connection(host_and_port(place), wall_s)
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return connected


def host_and_port(place: str) -> tuple[str, int]:
    """Return the two of `HOST:PORT`; of `:PORT` this machine's own address.

    Raises:
        ValueError: It is none.
    """
    host, _, port = place.rpartition(":")
    if not 0 <= int(port) < 2**16:
        raise ValueError(f"port {port}")
    return host or LOOPBACK, int(port)
