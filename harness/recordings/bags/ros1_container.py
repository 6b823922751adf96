"""Messages of a ROS 1 bag, by the bag format, version 2.0."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

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

MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, CHUNK, CONNECTION = 2, 5, 7
"""Values of the field `op` of the records that are read."""

LONGEST_HEADER = 2**20


def messages(path: Path, faults: Faults) -> Iterator[RawMessage]:
    """Yield the messages of a bag, in its order; count damaged and cut off ones.

    The index at its end is not used: a bag that was not closed is read as well.
    """
    size = path.stat().st_size
    walk = _Walk(faults)
    with path.open("rb") as file:
        if file.read(len(MAGIC)) != MAGIC:
            return
        try:
            while file.tell() < size:
                length = int.from_bytes(exactly(file, 4, size), "little")
                if length > LONGEST_HEADER:
                    raise Broken("a header of over a mebibyte")
                header = exactly(file, length, size)
                length = int.from_bytes(exactly(file, 4, size), "little")
                yield from walk.record(header, exactly(file, length, size))
        except (EOFError, Broken):
            faults[CUT] += 1


class _Walk:
    """Reader of a bag's records: the connections known so far."""

    def __init__(self, faults: Faults) -> None:
        self._faults = faults
        self._connections: dict[int, tuple[str, str]] = {}  # topic, type

    def record(
        self, header: bytes | memoryview, body: bytes | memoryview, in_chunk: bool = False
    ) -> Iterator[RawMessage]:
        """Take up one record, and yield the messages in it."""
        try:
            fields = _header(header)
            kind = _number(fields, b"op", 1)
            if kind == MESSAGE:
                yield self._message(fields, body)
            elif kind == CONNECTION:
                self._connection(fields, body)
            elif kind == CHUNK and not in_chunk:
                yield from self._chunk(fields, body)
        except Broken:
            self._faults[DAMAGED] += 1

    def _connection(self, fields: dict[bytes, bytes], body: bytes | memoryview) -> None:
        if len(self._connections) >= MOST_TOPICS:
            raise Broken("too many topics")
        number = _number(fields, b"conn", 4)
        described = _header(body)
        topic = fields.get(b"topic", b"").decode("utf-8", "replace")
        type_ = described.get(b"type", b"").decode("utf-8", "replace")
        self._connections[number] = same_path(topic), ros2_type(type_)

    def _message(self, fields: dict[bytes, bytes], body: bytes | memoryview) -> RawMessage:
        number = _number(fields, b"conn", 4)
        if number not in self._connections:
            raise Broken("a message of no connection")
        stamp = _number(fields, b"time", 8)
        logged_ns = (stamp & 0xFFFFFFFF) * 10**9 + (stamp >> 32)
        return RawMessage(*self._connections[number], "ros1", logged_ns, body)

    def _chunk(self, fields: dict[bytes, bytes], body: bytes | memoryview) -> Iterator[RawMessage]:
        compression = fields.get(b"compression", b"none").decode("ascii", "replace")
        inner = Fields(unpack(compression, body, _number(fields, b"size", 4)))
        while inner.left:
            header = inner.take(inner.number(4))
            yield from self.record(header, inner.take(inner.number(4)), in_chunk=True)


def _header(data: bytes | memoryview) -> dict[bytes, bytes]:
    """Return the fields of a header by name."""
    cursor = Fields(data)
    fields = {}
    while cursor.left:
        name, equals, value = bytes(cursor.take(cursor.number(4))).partition(b"=")
        if not equals:
            raise Broken("a field without a name")
        fields[name] = value
    return fields


def _number(fields: dict[bytes, bytes], name: bytes, size: int) -> int:
    value = fields.get(name, b"")
    if len(value) != size:
        raise Broken("a header without a field")
    return int.from_bytes(value, "little")
