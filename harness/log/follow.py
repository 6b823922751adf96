"""A log that is still being written, followed up to its end.

The writer hands on what is older than a second of simulated time, so a follower is that far behind.
It reads the file alone: whoever watches an episode cannot change it.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from google.protobuf.message import Message

from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import Attachment, Cut, Item, Metadata, Packet, walk_in
from wayproof.harness.log.codec.messages import decode, is_ours
from wayproof.harness.log.head import read_head
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.outputs import ENDING
from wayproof.harness.schema import wayproof_pb2 as pb

POLL_S = 0.05

TABLE = pb.SensorInfo.DESCRIPTOR.full_name

UNDER_WAY = "under way"
"""Outcome of a log that has none yet."""


class Growing:
    """Bytes of a file that another process appends to; a read waits for them until it ends."""

    def __init__(self, descriptor: int, path: Path, stop: threading.Event) -> None:
        """Begin at the first byte.

        Args:
            descriptor: Open for reading; it has no place of its own here.
            path: Name that the writer holds.
            stop: Set to wait no longer.
        """
        self._descriptor, self._path, self._stop = descriptor, path, stop
        self._place = 0

    def read(self, count: int) -> bytes:
        """Return a number of bytes, fewer only at the end of a file that is complete."""
        data = b""
        while True:
            ended = self._stop.is_set() or self._is_finished()
            data += os.pread(self._descriptor, count - len(data), self._place + len(data))
            if len(data) == count or ended:
                self._place += len(data)
                return data
            self._stop.wait(POLL_S)

    def _is_finished(self) -> bool:
        """Return whether the writer is done: it has renamed the file, or holds no lock on it."""
        try:
            there = self._path.stat()
        except FileNotFoundError:
            return True
        if not os.path.samestat(there, os.fstat(self._descriptor)):
            return True
        try:
            fcntl.flock(self._descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        fcntl.flock(self._descriptor, fcntl.LOCK_UN)
        return True


@dataclass(frozen=True, kw_only=True)
class FollowedLog(Log):
    """Log that is being written; its messages come as they are.

    Attributes:
        descriptor: Descriptor of the partial file, open for reading.
        stop: Set to wait for no more.
    """

    descriptor: int
    stop: threading.Event

    @property
    def under_way(self) -> bool:
        """Whether it is still being written, and may break off."""
        return True

    def messages(self, after_ns: int = -1) -> Iterator[Message]:
        """Yield every message after a time up to the end of the log, or of its writer."""
        growing = Growing(self.descriptor, self.path, self.stop)
        with contextlib.suppress(Cut):
            for item in walk_in(self.path, growing):
                if isinstance(item, Packet) and item.time_ns > after_ns and is_ours(item):
                    yield decode(item, self.path)

    def finished(self, allow_plugins: bool = False) -> Log:
        """Return the finished log, or this one if it ended without a result."""
        try:
            return open_log(finished_name(self.path), allow_plugins)
        except InputError:
            return self


def finished_name(partial: Path) -> Path:
    """Return the name that a partial log gets."""
    return partial.with_name(partial.name.removesuffix(ENDING))


def partial_name(path: Path) -> Path:
    """Return the name of a log while it is being written."""
    return path if path.name.endswith(ENDING) else path.with_name(path.name + ENDING)


@contextlib.contextmanager
def followed(path: Path, allow_plugins: bool = False) -> Iterator[FollowedLog]:
    """Follow a log that is being written; wait for its head.

    Args:
        path: Name of the log, with or without `.partial`.
        allow_plugins: Whether code that its config names may be imported.

    Raises:
        InputError: No log of that name is being written, or its writer ended before the first
            decision.
    """
    partial = partial_name(path)
    try:
        descriptor = os.open(partial, os.O_RDONLY)
    except OSError as error:
        raise InputError(
            f"log '{partial}': {error.strerror}; expected one that is being written"
        ) from None
    stop = threading.Event()
    try:
        head = read_head(_head(partial, Growing(descriptor, partial, stop)), partial, allow_plugins)
        yield FollowedLog(
            path=partial,
            config=head.config,
            mission=head.mission,
            scene=head.scene,
            run=head.run,
            result={"outcome": UNDER_WAY},
            beams=head.beams,
            descriptor=descriptor,
            stop=stop,
        )
    finally:
        stop.set()
        os.close(descriptor)


def _head(path: Path, growing: Growing) -> Iterator[Attachment | Metadata | Packet]:
    """Yield the items before the first sweep, pose or decision."""
    items: Iterator[Item] = walk_in(path, growing)
    try:
        for item in items:
            if isinstance(item, Packet) and item.schema != TABLE:
                return
            yield item
    except Cut:
        raise InputError(f"log '{path}': its writer ended before the first decision") from None
