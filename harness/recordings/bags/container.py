"""Parts that the containers of bags share: raw messages, fields of records, bounded unpacking."""

from __future__ import annotations

import bz2
from typing import IO, NamedTuple

import zstandard

from wayproof.harness.errors import InputError

GREATEST_RECORD = 2**28
"""Maximum size of a record or an unpacked chunk, bytes; a cloud of a million points takes 2^25."""

GREATEST_RATIO, LEAST_UNPACKED = 1024, 2**20
"""Maximum size of an unpacked chunk: its packed size times the first, plus the second, bytes."""

MOST_TOPICS = 10_000

CUT = "bag: cut short"
DAMAGED = "bag: damaged chunk or record"


class RawMessage(NamedTuple):
    """A message, still encoded.

    Attributes:
        topic: Topic.
        type: Name of its type, as `sensor_msgs/msg/LaserScan`.
        encoding: `cdr` or `ros1`.
        logged_ns: Time at which it was recorded, ns.
        data: Its bytes, valid until the next message is read.
    """

    topic: str
    type: str
    encoding: str
    logged_ns: int
    data: bytes | memoryview


class Broken(Exception):
    """A record, or a chunk, cannot be parsed."""


class Fields:
    """The fields of a record, never beyond its end."""

    def __init__(self, data: bytes | memoryview) -> None:
        """Begin at the first byte."""
        self._data = memoryview(data)
        self._place = 0

    @property
    def left(self) -> int:
        """Number of bytes that are left."""
        return len(self._data) - self._place

    def take(self, count: int) -> memoryview:
        """Return the next bytes."""
        if count > self.left:
            raise Broken(f"a field of {count} bytes with {self.left} left")
        piece = self._data[self._place : self._place + count]
        self._place += count
        return piece

    def number(self, size: int) -> int:
        """Return the next little-endian number of a size in bytes."""
        return int.from_bytes(self.take(size), "little")

    def text(self) -> str:
        """Return the next text, its length before it."""
        return str(self.take(self.number(4)), "utf-8", "replace")


def exactly(file: IO[bytes], count: int, size: int) -> bytes:
    """Read a number of bytes of a file of a size.

    Raises:
        EOFError: They are not there.
        Broken: More than a record may have.
    """
    if count > size - file.tell():
        raise EOFError
    if count > GREATEST_RECORD:
        raise Broken(f"a record of {count} bytes")
    return file.read(count)


def unpack(compression: str, packed: bytes | memoryview, size: int) -> bytes | memoryview:
    """Decompress a chunk that states its size.

    Raises:
        Broken: It is larger than a chunk may be, or is not of that size, or is damaged.
    """
    if size > min(GREATEST_RECORD, LEAST_UNPACKED + GREATEST_RATIO * len(packed)):
        raise Broken(f"a chunk of {len(packed)} bytes that unpacks to {size}")
    if compression in ("", "none"):
        data: bytes | memoryview = packed
    elif compression == "zstd":
        data = _zstd(packed, size)
    elif compression == "bz2":
        data = _bz2(packed, size)
    elif compression == "lz4":
        data = _lz4(packed, size)
    else:
        raise Broken(f"compression '{compression[:20]}'")
    if len(data) != size:
        raise Broken(f"a chunk that does not unpack to {size} bytes")
    return data


def unpacked_message(data: bytes | memoryview) -> bytes | memoryview:
    """Return a message, decompressed if it begins like zstd (`compression_mode: message`).

    Raises:
        Broken: It is damaged, or larger than its packed bytes can account for.
    """
    if bytes(data[:4]) != zstandard.FRAME_HEADER:
        return data
    most = min(GREATEST_RECORD, LEAST_UNPACKED + GREATEST_RATIO * len(data))
    unpacked = _zstd(data, most)
    if len(unpacked) > most:
        raise Broken("a message that unpacks to far more than its bytes")
    return unpacked


def ros2_type(name: str) -> str:
    """Return the name of a type as ROS 2 writes it: `package/msg/Name`."""
    package, _, rest = name.partition("/")
    return name if rest.startswith("msg/") else f"{package}/msg/{rest}"


def same_path(topic: str) -> str:
    """Return a topic without repeated slashes."""
    return "/" * topic.startswith("/") + "/".join(part for part in topic.split("/") if part)


def _zstd(packed: bytes | memoryview, size: int) -> bytes:
    try:
        with zstandard.ZstdDecompressor().stream_reader(bytes(packed)) as stream:
            return stream.read(size + 1)
    except (zstandard.ZstdError, MemoryError):
        raise Broken("zstd data that is damaged") from None


def _bz2(packed: bytes | memoryview, size: int) -> bytes:
    try:
        return bz2.BZ2Decompressor().decompress(packed, size + 1)
    except (OSError, EOFError, ValueError):
        raise Broken("bz2 data that is damaged") from None


def _lz4(packed: bytes | memoryview, size: int) -> bytes:
    try:
        from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]
    except ImportError:
        raise InputError("lz4: not installed, expected the extra 'recordings'") from None
    try:
        data: bytes = LZ4FrameDecompressor().decompress(bytes(packed), max_length=size + 1)
    except (RuntimeError, EOFError, ValueError, MemoryError):
        raise Broken("lz4 data that is damaged") from None
    return data
