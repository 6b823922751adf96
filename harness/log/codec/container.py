"""Parser of MCAP files, record by record, for files that are not to be trusted.

A log is untrusted input, and a disk may have lost bytes of it. Every length is compared with the
rest of the file before memory of that size is allocated, every chunk with the size that it may
decompress to, and every checksum of the format is recomputed. Records follow the MCAP
specification, version 0; only its fixed layouts are parsed, and no name in a file becomes a path.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, NamedTuple, Protocol

from mcap.opcode import Opcode

from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.census import Census
from wayproof.harness.log.codec.fields import Broken, Cursor, decompress

MAGIC = b"\x89MCAP0\r\n"

GREATEST_RECORD = 64 * 2**20
"""Maximum size of a record, an attachment, or a decompressed chunk, bytes."""

MOST_BYTES = 2**40
"""Size that a file being written is taken to have, bytes: more than any log."""

GREATEST_RATIO = 4096
"""Maximum ratio of decompressed chunks to file size; sweeps of an empty world reach 800."""

PROFILE = b"wayproof"
"""Profile in the head of every log, which tells it from the MCAP files of other programs."""

LONGEST_HEAD = 512
"""Length of a file's beginning that is read for its profile and library, bytes."""

HEAD = struct.Struct("<BQ")  # opcode, length
LENGTH = struct.Struct("<I")  # of a text
MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, time of the log, time of publication


class Attachment(NamedTuple):
    """An attachment: a named file in the file."""

    name: str
    data: bytes


class Metadata(NamedTuple):
    """A metadata record: named text fields."""

    name: str
    fields: dict[str, str]


class Packet(NamedTuple):
    """A message, still encoded."""

    schema: str
    topic: str
    time_ns: int
    data: bytes


Item = Attachment | Metadata | Packet


class Cut(InputError):
    """The file breaks off before its end."""


class Source(Protocol):
    """Bytes of a file, in order."""

    def read(self, count: int, /) -> bytes:
        """Return a number of bytes, fewer only at the end."""

    def tell(self) -> int:
        """Return the number of bytes read."""

    def ends_with(self, mark: bytes) -> bool:
        """Return whether the file ends with these bytes."""


class _Whole:
    """Bytes of a complete file."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file
        self.read, self.tell = file.read, file.tell

    def ends_with(self, mark: bytes) -> bool:
        self._file.seek(-len(mark), 2)
        return self._file.read() == mark


def origin_of(path: Path) -> tuple[bytes, bytes]:
    """Return the profile and the library in an MCAP file's head, both empty if it has none."""
    with path.open("rb") as file:
        head = file.read(LONGEST_HEAD)
    if not head.startswith(MAGIC + bytes([Opcode.HEADER])):
        return b"", b""
    names, place = [], len(MAGIC) + HEAD.size
    for _ in range(2):
        begin = place + LENGTH.size
        place = begin + int.from_bytes(head[place:begin], "little")
        names.append(head[begin:place])
    return names[0], names[1]


def is_mcap(path: Path) -> bool:
    """Return whether there is a file that begins as an MCAP file of any program."""
    if not os.path.isfile(path):  # nor under a name that the system refuses
        return False
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def is_log(path: Path) -> bool:
    """Return whether a file begins as a log, finished or not, and not as another MCAP file."""
    return origin_of(path)[0] == PROFILE


def walk(path: Path, head_only: bool = False) -> Iterator[Item]:
    """Yield every item of a file, in file order.

    Args:
        path: The file.
        head_only: Whether to decompress no chunk after the first; all checksums of the file's bytes
            are recomputed all the same.

    Raises:
        InputError: The file breaks off, a checksum does not hold, or a record is malformed. The
            message names the byte, and for a chunk its simulated time. Items yielded before are
            sound.
    """
    try:
        with path.open("rb") as file:
            size = path.stat().st_size
            yield from _Walk(path, _Whole(file), size, head_only).items()
    except OSError as error:
        raise InputError(f"log '{path}': {error.strerror}") from None


def walk_in(path: Path, source: Source) -> Iterator[Item]:
    """Yield every item of a file whose size is not known yet, in file order.

    Args:
        path: Name of the file, for messages.
        source: Its bytes.

    Raises:
        Cut: They end before the file does.
        InputError: As `walk`, but for limits that depend on the file's size.
    """
    yield from _Walk(path, source, MOST_BYTES, head_only=False).items()


class _Walk:
    """One pass over a file."""

    def __init__(self, path: Path, file: Source, size: int, head_only: bool) -> None:
        self._path = path
        self._file = file
        self._size = size
        self._head_only = head_only
        self._chunks = 0
        self._unpacked = 0
        self._census = Census(self._size)
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, tuple[str, str]] = {}  # topic, schema's name

    def items(self) -> Iterator[Item]:
        magic = self._file.read(len(MAGIC))
        if magic != MAGIC:
            raise InputError(f"log '{self._path}': not an MCAP file")
        checksum = zlib.crc32(magic)
        while True:
            offset = self._file.tell()
            opcode, head, body = self._next(offset)
            try:
                if opcode == Opcode.DATA_END:
                    self._check_data(body, checksum)
                    self._check_summary()
                    return
                yield from self._parse(opcode, body)
            except Broken as error:
                raise self._damaged(f"{error}, {_name(opcode, body)} at byte {offset}") from None
            checksum = zlib.crc32(body, zlib.crc32(head, checksum))

    def _next(self, offset: int) -> tuple[int, bytes, bytes]:
        """Return the record at an offset: its opcode, the bytes of its head, and its body."""
        head = self._file.read(HEAD.size)
        if len(head) < HEAD.size:
            raise self._cut(f"no end of data in {self._file.tell()} bytes")
        opcode, length = HEAD.unpack(head)
        left = self._size - offset - HEAD.size
        if length > GREATEST_RECORD:
            raise self._damaged(f"a record of {length} bytes at byte {offset}")
        if length > left:
            raise self._cut(f"{left} of {length} bytes of the record at byte {offset}")
        body = self._file.read(length)
        if len(body) < length:
            raise self._cut(f"{len(body)} of {length} bytes of the record at byte {offset}")
        return opcode, head, body

    def _parse(self, opcode: int, body: bytes) -> Iterator[Item]:
        cursor = Cursor(body)
        if opcode == Opcode.CHUNK:
            self._chunks += 1
            if self._chunks == 1 or not self._head_only:
                yield from self._unpack(cursor)
        elif opcode == Opcode.ATTACHMENT:
            yield _attachment(cursor, body)
        elif opcode == Opcode.METADATA:
            yield Metadata(cursor.text(), cursor.pairs())
        else:
            yield from self._parse_in_chunk(opcode, cursor)

    def _parse_in_chunk(self, opcode: int, cursor: Cursor) -> Iterator[Packet]:
        """Parse a record of a chunk, or of a file without chunks."""
        if opcode == Opcode.SCHEMA:
            number = cursor.number(2)
            self._schemas[number] = cursor.text()
        elif opcode == Opcode.CHANNEL:
            number, schema = cursor.number(2), cursor.number(2)
            self._channels[number] = cursor.text(), self._schemas.get(schema, "")
        elif opcode == Opcode.MESSAGE:
            number, _, time_ns, _ = MESSAGE.unpack(cursor.take(MESSAGE.size))
            if number not in self._channels:
                raise Broken(f"a message on channel {number}, which was never declared")
            topic, schema_name = self._channels[number]
            self._census.count(schema_name, topic, cursor.left)
            yield Packet(schema_name, topic, time_ns, cursor.take(cursor.left))

    def _unpack(self, cursor: Cursor) -> Iterator[Packet]:
        cursor.skip(16)
        size, checksum = cursor.number(8), cursor.number(4)
        compression, packed = cursor.text(), cursor.take(cursor.number(8))
        self._unpacked += size
        if size > GREATEST_RECORD:
            raise Broken(f"unpacks to {size} bytes, expected at most {GREATEST_RECORD}")
        if self._unpacked > GREATEST_RATIO * self._size:
            raise Broken(f"unpacks to over {GREATEST_RATIO} times the file's size")
        data = decompress(compression, packed, size)
        if checksum != 0 and zlib.crc32(data) != checksum:
            raise Broken("checksum does not hold")
        inner = Cursor(data)
        while inner.left:
            opcode, length = HEAD.unpack(inner.take(HEAD.size))
            if opcode != Opcode.MESSAGE:
                self._census.count_declared()
            yield from self._parse_in_chunk(opcode, inner.part(length))

    def _check_data(self, body: bytes, checksum: int) -> None:
        expected = Cursor(body).number(4)
        if expected not in (0, checksum):
            raise Broken("checksum of all bytes up to here does not hold, at")

    def _check_summary(self) -> None:
        """Check index, footer and final magic, of which only the checksums are used."""
        tail = self._file.read(GREATEST_RECORD + 1)
        footer = HEAD.size + 20
        if len(tail) > GREATEST_RECORD or len(tail) < footer + len(MAGIC):
            raise Broken(f"an index of {len(tail)} bytes after")
        if tail[-len(MAGIC) :] != MAGIC:
            raise self._cut(f"no end mark in {self._file.tell()} bytes")
        signed = tail[: -len(MAGIC) - 4]
        expected = int.from_bytes(tail[-len(MAGIC) - 4 : -len(MAGIC)], "little")
        if expected not in (0, zlib.crc32(signed)):
            raise Broken("checksum of the index does not hold, after")

    def _cut(self, what: str) -> InputError:
        """Return the error of a file that breaks off; with an end mark it is not just cut short."""
        if self._file.ends_with(MAGIC):
            return self._damaged(what)
        return Cut(f"log '{self._path}': truncated ({what})")

    def _damaged(self, what: str) -> InputError:
        return InputError(f"log '{self._path}': damaged ({what})")


def _attachment(cursor: Cursor, body: bytes) -> Attachment:
    cursor.take(16)
    name = cursor.text()
    cursor.text()
    data, checksum = cursor.take(cursor.number(8)), cursor.number(4)
    if checksum not in (0, zlib.crc32(body[:-4])):
        raise Broken(f"checksum of '{name[:40]}' does not hold")
    return Attachment(name, data)


def _name(opcode: int, body: bytes) -> str:
    """Return the kind of a record, and for a chunk its simulated time."""
    if opcode != Opcode.CHUNK or len(body) < 16:
        return {9: "attachment", 12: "metadata", 15: "end of data"}.get(opcode, f"record {opcode}")
    begin, end = struct.unpack_from("<QQ", body)
    return f"chunk of {begin * 1e-9:.1f} to {end * 1e-9:.1f} s"
