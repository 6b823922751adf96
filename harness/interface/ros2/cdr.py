"""CDR of ROS 2 messages: XCDR version 1 of final types, OMG DDS-XTypes 1.3, section 7.4.

Arrays of numbers are copied as a whole: a cloud of a megabyte takes a fraction of a millisecond.
"""

from __future__ import annotations

import struct
from typing import Annotated, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.interface.ros2.messages import Code, Message

HEADER = b"\0\1\0\0"
"""Encapsulation of plain CDR, little-endian."""

BIG_ENDIAN, LITTLE_ENDIAN = b"\0\0", b"\0\1"

M = TypeVar("M", bound=Message)
Value = object


class CdrError(ValueError):
    """Bytes that are no message of the type, in one line."""


class Kind(NamedTuple):
    """Type of a field: text, numbers, a message, or a sequence of messages."""

    code: Code | None = None
    message: type[Message] | None = None
    sequence: bool = False


_fields: dict[str, tuple[tuple[str, Kind], ...]] = {}


def fields_of(kind: type[Message]) -> tuple[tuple[str, Kind], ...]:
    """Return the fields of a message in order, each with its type."""
    if kind.TYPE not in _fields:
        hints = get_type_hints(kind, include_extras=True)
        known = [(name, _kind(hint)) for name, hint in hints.items() if name != "TYPE"]
        _fields[kind.TYPE] = tuple(known)
    return _fields[kind.TYPE]


def _kind(hint: object) -> Kind:
    if get_origin(hint) is Annotated:
        return Kind(code=get_args(hint)[1])
    if get_origin(hint) is tuple:
        return Kind(message=get_args(hint)[0], sequence=True)
    return Kind() if hint is str else Kind(message=hint)  # type: ignore[arg-type]


def encode(message: Message) -> bytes:
    """Encode a message, with the header of the encapsulation."""
    writer = Writer()
    writer.message(message)
    return writer.finish()


def decode(kind: type[M], data: bytes) -> M:
    """Decode a message.

    Raises:
        CdrError: They end early, or are in another encoding.
    """
    return Reader(data).message(kind)


class Writer:
    """Appends values, each aligned to its own size."""

    PADDING = b"\0"

    def __init__(self) -> None:
        """Start with nothing; alignment counts from after the header."""
        self._parts, self._length = [HEADER], 0

    def finish(self) -> bytes:
        """Return the header and what was appended after it."""
        return b"".join(self._parts)

    def message(self, message: Message) -> None:
        """Append the fields of a message."""
        for name, kind in fields_of(type(message)):
            self._field(getattr(message, name), kind)

    def _field(self, value: Value, kind: Kind) -> None:
        if kind.code is not None:
            self._numbers(value, kind.code)
        elif kind.sequence:
            assert isinstance(value, tuple)
            self._pack("I", len(value))
            for one in value:
                self.message(one)
        elif isinstance(value, Message):
            self.message(value)
        else:
            data = str(value).encode() + b"\0"
            self._pack("I", len(data))
            self._append(data)

    def _numbers(self, value: Value, code: Code) -> None:
        if code.length is None:
            self._pack(np.dtype(code.dtype).char, value)
            return
        array: NDArray[np.generic] = np.ascontiguousarray(value, "<" + code.dtype).ravel()
        if code.length == 0:
            self._pack("I", len(array))
        elif len(array) != code.length:
            raise CdrError(f"got {len(array)} numbers, expected {code.length}")
        if len(array):
            self._align(array.itemsize)
            self._append(array.tobytes())

    def _pack(self, char: str, value: Value) -> None:
        form = "<" + char
        self._align(struct.calcsize(form))
        self._append(struct.pack(form, value))

    def _align(self, size: int) -> None:
        self._append(self.PADDING * (-self._length % size))

    def _append(self, data: bytes) -> None:
        self._parts.append(data)
        self._length += len(data)


class Reader:
    """Takes values, each aligned to its own size."""

    def __init__(self, data: bytes) -> None:
        """Start after the header.

        Raises:
            CdrError: The encoding is another one.
        """
        if data[:2] not in (BIG_ENDIAN, LITTLE_ENDIAN) or len(data) < len(HEADER):
            raise CdrError(f"got encapsulation {data[:4].hex()}, expected plain CDR (XCDR1)")
        self._order = "<" if data[:2] == LITTLE_ENDIAN else ">"
        self._data, self._place = memoryview(data)[len(HEADER) :], 0

    def message(self, kind: type[M]) -> M:
        """Take the fields of a message."""
        return kind(**{name: self._field(one) for name, one in fields_of(kind)})

    def _field(self, kind: Kind) -> Value:
        if kind.code is not None:
            return self._numbers(kind.code)
        if kind.message is None:
            return self._text()
        if not kind.sequence:
            return self.message(kind.message)
        count = self._count(1)
        return tuple(self.message(kind.message) for _ in range(count))

    def _numbers(self, code: Code) -> Value:
        dtype = np.dtype(code.dtype).newbyteorder(self._order)  # type: ignore[arg-type]
        if code.length is None:
            return self._take(dtype, 1)[0].item()
        count = code.length or self._count(dtype.itemsize)
        return self._take(dtype, count).astype(code.dtype)

    def _text(self) -> str:
        data = bytes(self._bytes(self._count(1)))
        try:
            return data.rstrip(b"\0").decode()
        except UnicodeDecodeError:
            raise CdrError(f"got the bytes {data[:20].hex()}, expected UTF-8") from None

    def _count(self, size: int) -> int:
        """Read a number of elements, each of at least so many bytes."""
        count = int(self._take(np.dtype(self._order + "u4"), 1)[0])
        if count * size > len(self._data) - self._place:
            raise CdrError(f"got a sequence of {count} in {len(self._data)} bytes")
        return count

    def _take(self, dtype: np.dtype[np.generic], count: int) -> NDArray[np.generic]:
        if count:
            self._bytes(-self._place % dtype.itemsize)
        return np.frombuffer(self._bytes(count * dtype.itemsize), dtype, count)

    def _bytes(self, count: int) -> memoryview:
        end = self._place + count
        if end > len(self._data):
            raise CdrError(f"got {len(self._data)} bytes, expected at least {end}")
        taken, self._place = self._data[self._place : end], end
        return taken
