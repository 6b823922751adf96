"""Messages of an MCAP file, by the MCAP specification, version 0."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from pathlib import Path

from mcap.opcode import Opcode

from wayproof.harness.recordings.bags.container import (
    CUT,
    DAMAGED,
    MOST_TOPICS,
    Broken,
    Fields,
    RawMessage,
    exactly,
    ros2_type,
    same_path,
    unpack,
)
from wayproof.harness.recordings.recording import Faults

MAGIC = b"\x89MCAP0\r\n"
ENCODINGS = ("cdr", "ros1")


def messages(path: Path, faults: Faults) -> Iterator[RawMessage]:
    """Yield the messages of ROS in a file, in its order; count damaged and cut off ones."""
    size = path.stat().st_size
    walk = _Walk(faults)
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            return
        try:
            while True:
                head = exactly(file, 9, size)
                opcode, length = head[0], int.from_bytes(head[1:], "little")
                if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                    return
                yield from walk.record(opcode, exactly(file, length, size))
        except (EOFError, Broken):
            faults[CUT] += 1


class _Walk:
    """Reader of a file's records: the schemas and channels known so far."""

    def __init__(self, faults: Faults) -> None:
        self._faults = faults
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, tuple[str, str, str]] = {}  # topic, type, encoding

    def record(self, opcode: int, body: bytes | memoryview) -> Iterator[RawMessage]:
        """Take up one record, and yield the messages in it."""
        try:
            if opcode == Opcode.CHUNK:
                yield from self._chunk(Fields(body))
            elif opcode == Opcode.MESSAGE:
                yield from self._message(Fields(body))
            elif opcode == Opcode.SCHEMA:
                fields = Fields(body)
                number = fields.number(2)
                self._schemas[number] = fields.text()
            elif opcode == Opcode.CHANNEL:
                self._channel(Fields(body))
        except Broken:
            self._faults[DAMAGED] += 1

    def _channel(self, fields: Fields) -> None:
        if len(self._channels) >= MOST_TOPICS:
            raise Broken("too many topics")
        number, schema = fields.number(2), fields.number(2)
        topic, encoding = fields.text(), fields.text()
        type_ = ros2_type(self._schemas.get(schema, ""))
        self._channels[number] = same_path(topic), type_, encoding

    def _message(self, fields: Fields) -> Iterator[RawMessage]:
        number = fields.number(2)
        fields.take(4)
        logged_ns = fields.number(8)
        fields.take(8)
        if number not in self._channels:
            raise Broken("a message of no channel")
        topic, type_, encoding = self._channels[number]
        if encoding in ENCODINGS:
            yield RawMessage(topic, type_, encoding, logged_ns, data=fields.take(fields.left))

    def _chunk(self, fields: Fields) -> Iterator[RawMessage]:
        fields.take(16)
        size, checksum = fields.number(8), fields.number(4)
        compression = fields.text()
        data = unpack(compression, fields.take(fields.number(8)), size)
        if checksum and zlib.crc32(data) != checksum:
            raise Broken("a checksum that does not hold")
        inner = Fields(data)
        while inner.left:
            opcode, length = inner.number(1), inner.number(8)
            if opcode == Opcode.CHUNK:
                raise Broken("a chunk in a chunk")
            yield from self.record(opcode, inner.take(length))
