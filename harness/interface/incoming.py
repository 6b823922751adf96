"""Messages of a harness as another process reads them: bounded in size and time."""

from __future__ import annotations

import math
import os
import select
import struct
import time
from collections.abc import Callable

from google.protobuf.message import DecodeError

from wayproof.harness.errors import InputError
from wayproof.harness.interface.remote import MAX_MESSAGE
from wayproof.harness.schema import stack_pb2 as sb

POLLED_S = 2e-3
"""Time for which an announced observation is polled for, s: the harness makes it in a tenth."""

READ_AT_ONCE = 2**20
"""Bytes that one call reads: memory grows as they come, not with the length that is stated."""

MESSAGE_S = 30.0
"""Wall time within which a message that has begun is there, or an answer is taken, s."""


class NotHarness(InputError):
    """What came is none of a harness's messages; the connection ends."""


class Incoming:
    """Messages of the harness from a descriptor."""

    def __init__(self, read: int) -> None:
        """Read from an open descriptor."""
        self._read, self._poll = read, select.poll()
        self._poll.register(read, select.POLLIN)

    def next(
        self, within_s: float | None = None, rehearse: Callable[[], None] = lambda: None
    ) -> sb.ToStack | None:
        """Return the next message; None at the end.

        Args:
            within_s: Wall time until the message begins, s; None for any.
            rehearse: Called whenever an observation is announced.

        Raises:
            NotHarness: It is none, too long, or too late.
        """
        until = math.inf if within_s is None else time.monotonic() + within_s
        while (head := self._exactly(4, until)) is not None:
            (length,) = struct.unpack("<I", head)
            if length > MAX_MESSAGE:
                raise NotHarness(f"got a message of {length} bytes, expected {MAX_MESSAGE} at most")
            if length:
                data = self._exactly(length, time.monotonic() + MESSAGE_S)
                return None if data is None else _message_of(data)
            rehearse()
            self._stay_awake()
        return None

    def _exactly(self, count: int, until: float) -> bytes | None:
        """Return a number of bytes by a time of `time.monotonic`; None if the input ends before."""
        data = bytearray()
        while len(data) < count:
            left_s = until - time.monotonic()
            if left_s <= 0.0 or not self._poll.poll(None if left_s == math.inf else 1e3 * left_s):
                raise NotHarness(f"got {len(data)} of {count} bytes in time")
            try:
                part = os.read(self._read, min(count - len(data), READ_AT_ONCE))
            except BlockingIOError:
                continue
            if not part:
                return None
            data += part
        return bytes(data)

    def _stay_awake(self) -> None:
        """Stay awake until an announced observation comes, or for `POLLED_S`."""
        until = time.monotonic() + POLLED_S
        while not self._poll.poll(0) and time.monotonic() < until:
            os.sched_yield()  # the harness may be waiting for this very core


def _message_of(data: bytes) -> sb.ToStack:
    try:
        return sb.ToStack.FromString(data)
    except DecodeError:
        raise NotHarness(
            f"got {len(data)} bytes that are no message of the stack interface"
        ) from None
