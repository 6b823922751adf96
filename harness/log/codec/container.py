"""Reading of MCAP files that are not to be trusted, by the records of the mcap package.

A log is untrusted input, and a disk may have lost bytes of it. Every size is compared with its
bound before anything of that size is made, and every checksum of the format is recomputed, except
those of attachments, which the checksum of all data covers. No name in a file becomes a path.

Other programs read an MCAP file by its index. So the index has to list what the file holds, chunk
by chunk and message by message, and nothing else, or they would read another story than we do.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, InvalidMagic, McapError
from mcap.opcode import Opcode
from mcap.stream_reader import StreamReader, get_chunk_data_stream

from wayproof.harness.errors import InputError
from wayproof.harness.schema import wayproof_pb2 as pb

MAGIC = b"\x89MCAP0\r\n"

GREATEST_RECORD = 64 * 2**20
"""Maximum size of a record, an attachment, or a decompressed chunk, bytes."""

MOST_BYTES = 2**40
"""Size that a file being written is taken to have, bytes: more than any log."""

GREATEST_RATIO = 4096
"""Maximum ratio of decompressed chunks to file size; sweeps of an empty world reach 800."""

LEAST_DATA = 2**20
GREATEST_DATA_RATIO = 32
"""Maximum ratio of message data but sweeps, beyond `LEAST_DATA` bytes, to the file size; an episode
reaches 1.3. A message takes many times its bytes in memory: two bytes make a point of a path."""

LEAST_RECORDS, LEAST_BYTES = 20_000, 16
"""Number of records in chunks allowed in any file, and file size for each beyond them, bytes;
messages of an episode take 800 and more."""

SWEEPS = (pb.Sweep.DESCRIPTOR.full_name, pb.SensorInfo.DESCRIPTOR.full_name)

PROFILE = b"wayproof"
"""Profile in the head of every log, which tells it from the MCAP files of other programs."""

LONGEST_HEAD = 512
"""Length of a file's beginning that is read for its profile and library, bytes."""

HEAD = struct.Struct("<BQ")  # opcode, length
LENGTH = struct.Struct("<I")  # of a text
MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, time of the log, time of publication

BROKEN = (McapError, ValueError, struct.error, zstandard.ZstdError, OverflowError, MemoryError)
"""What the mcap package raises for a malformed record."""


class Attachment(NamedTuple):
    """An attachment: a named file in the file."""

    name: str
    data: bytes


class Metadata(NamedTuple):
    """A metadata record: named text fields."""

    name: str
    fields: dict[str, str]


class Packet(NamedTuple):
    """A message, still encoded; with the description of its schema as it was read from a file."""

    schema: str
    topic: str
    time_ns: int
    data: bytes
    description: bytes = b""


Item = Attachment | Metadata | Packet


class Cut(InputError):
    """The file breaks off before its end."""


class Source(Protocol):
    """Bytes of a file, in order."""

    def read(self, count: int, /) -> bytes:
        """Return a number of bytes, fewer only at the end."""


class _Exact:
    """Bytes of a source, each read of as many as were asked for."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self.count = 0

    def read(self, count: int) -> bytes:
        if not 0 <= count <= GREATEST_RECORD:
            raise ValueError(f"a field of {count} bytes")
        data = self._source.read(count)
        self.count += len(data)
        if len(data) < count:
            raise EndOfFile(f"{len(data)} of {count} bytes")
        return data


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
            file.seek(max(size - len(MAGIC), 0))
            ended = file.read() == MAGIC
            file.seek(0)
            yield from _Walk(path, file, size, head_only, ended).items()
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
    yield from _Walk(path, source, MOST_BYTES).items()


class _Walk:
    """One pass over a file."""

    def __init__(
        self,
        path: Path,
        source: Source,
        size: int,
        head_only: bool = False,
        ended: bool = False,
    ) -> None:
        self._path = path
        self._source, self._bytes = source, _Exact(source)
        self._size = size
        self._head_only = head_only
        self._ended = ended  # whether its last bytes are an end mark
        self._chunks = self._unpacked = self._records = self._data = 0
        self._most_records = LEAST_RECORDS + size // LEAST_BYTES
        self._most_data = LEAST_DATA + GREATEST_DATA_RATIO * size
        self._schemas: dict[int, records.Schema] = {}
        self._channels: dict[int, records.Channel] = {}
        self._counts: Counter[int] = Counter()  # messages by channel
        self._places: list[tuple[object, ...]] = []  # what the index has to list
        self._indexes: dict[int, int] = {}  # place of that of each channel, behind the last chunk
        self._entries: dict[int, list[tuple[int, int]]] = {}  # of the last chunk, by channel

    def items(self) -> Iterator[Item]:
        reader = StreamReader(
            self._bytes,  # type: ignore[arg-type]
            emit_chunks=True,
            validate_crcs=True,
            record_size_limit=GREATEST_RECORD,
        )
        offset, name = len(MAGIC), "record"
        try:
            for one in reader.records:
                name = _name(one)
                if isinstance(one, records.DataEnd):
                    self._check_summary()
                    return
                yield from self._parse(one)
                self._keep_place(one, offset)
                offset, name = self._bytes.count, "record"
            raise ValueError("no end of data")
        except EndOfFile as error:
            what = f"{error}, {name} at byte {offset}"
            if self._ended:
                raise self._damaged(what) from None
            raise Cut(f"log '{self._path}': truncated ({what})") from None
        except InvalidMagic:
            raise InputError(f"log '{self._path}': not an MCAP file") from None
        except BROKEN as error:
            raise self._damaged(f"{error}, {name} at byte {offset}") from None

    def _parse(self, one: records.McapRecord) -> Iterator[Item]:
        if isinstance(one, records.Chunk):
            self._chunks += 1
            if self._chunks == 1 or not self._head_only:
                yield from self._unpack(one)
        elif isinstance(one, records.Attachment):
            yield Attachment(one.name, one.data)
        elif isinstance(one, records.Metadata):
            yield Metadata(one.name, one.metadata)
        elif isinstance(one, records.Message):
            raise ValueError("a message outside a chunk")
        elif isinstance(one, records.MessageIndex):
            self._check_entries(one)
        else:
            self._declare(one)

    def _unpack(self, chunk: records.Chunk) -> Iterator[Packet]:
        size = chunk.uncompressed_size
        self._unpacked += size
        if size > GREATEST_RECORD:
            raise ValueError(f"unpacks to {size} bytes, expected at most {GREATEST_RECORD}")
        if self._unpacked > GREATEST_RATIO * self._size:
            raise ValueError(f"unpacks to over {GREATEST_RATIO} times the file's size")
        if chunk.compression not in ("", "zstd"):
            raise ValueError(f"compression {chunk.compression[:20]!r}, expected 'zstd' or none")
        if chunk.compression == "zstd":
            declared = zstandard.frame_content_size(chunk.data)
            if declared not in (-1, size):
                raise ValueError(f"unpacks to {declared} bytes, expected {size}")
        stream, length = get_chunk_data_stream(chunk, validate_crc=True)
        self._check_no_entry_left()
        data, place, first_ns, last_ns = stream.read(length), 0, 2**64, -1
        while place < length:
            opcode, count = HEAD.unpack_from(data, place)
            begin, place = place, place + HEAD.size
            self._records += 1
            if self._records > self._most_records:
                raise ValueError(f"over {self._most_records} records in chunks")
            if opcode == Opcode.MESSAGE:
                number, _, time_ns, published_ns = MESSAGE.unpack_from(data, place)
                if time_ns != published_ns:
                    raise ValueError(f"a message of {time_ns} ns published at {published_ns} ns")
                first_ns, last_ns = min(first_ns, time_ns), max(last_ns, time_ns)
                self._entries.setdefault(number, []).append((time_ns, begin))
                yield self._packet(number, time_ns, data[place + MESSAGE.size : place + count])
            elif opcode in DECLARATIONS:
                body = ReadDataStream(BytesIO(data[place : place + count]))
                self._declare(DECLARATIONS[opcode].read(body))
            place += count
        if last_ns >= 0 and (first_ns, last_ns) != (
            chunk.message_start_time,
            chunk.message_end_time,
        ):
            raise ValueError(f"messages of {first_ns} to {last_ns} ns")

    def _declare(self, one: records.McapRecord) -> None:
        same: object = one
        if isinstance(one, records.Schema):
            same = self._schemas.setdefault(one.id, one)
        elif isinstance(one, records.Channel):
            same = self._channels.setdefault(one.id, one)
        if same != one:
            raise ValueError(f"{_name(one)} declared in two ways")

    def _keep_place(self, one: records.McapRecord, offset: int) -> None:
        """Keep what the index has to say of a record that was read at an offset."""
        length = self._bytes.count - offset
        if isinstance(one, records.Chunk):
            times = one.message_start_time, one.message_end_time
            sizes = len(one.data), one.uncompressed_size
            self._indexes = {}
            self._places.append(("chunk", offset, length, *times, *sizes, self._indexes))
        elif isinstance(one, records.MessageIndex):
            self._indexes[one.channel_id] = offset
        elif isinstance(one, (records.Attachment, records.Metadata)):
            self._places.append((_name(one), offset, length, one.name))

    def _check_entries(self, index: records.MessageIndex) -> None:
        """Check that the index of a chunk lists its messages on a channel."""
        if self._head_only and self._chunks > 1:
            return  # they were not read
        if self._entries.pop(index.channel_id, []) != index.records:
            raise ValueError(f"it does not list the messages on channel {index.channel_id}")

    def _check_no_entry_left(self) -> None:
        """Check that each message of the last chunk was in an index behind it."""
        if self._entries:
            raise ValueError(f"no index of the messages on channel {min(self._entries)}, before")

    def _packet(self, channel: int, time_ns: int, data: bytes) -> Packet:
        if channel not in self._channels:
            raise ValueError(f"a message on channel {channel}, which was never declared")
        declared = self._channels[channel]
        known = self._schemas.get(declared.schema_id)
        schema, topic = "" if known is None else known.name, declared.topic
        self._counts[channel] += 1
        if schema not in SWEEPS:
            self._data += len(data)
            if self._data > self._most_data:
                raise ValueError(f"over {self._most_data} bytes of messages other than sweeps")
        return Packet(schema, topic, time_ns, data, b"" if known is None else known.data)

    def _check_summary(self) -> None:
        """Check that the index lists what the file holds, and all checksums behind the data."""
        self._check_no_entry_left()
        begin = self._bytes.count
        tail = self._source.read(GREATEST_RECORD + 1)
        footer = HEAD.size + 20
        if len(tail) < footer + len(MAGIC) or not tail.endswith(MAGIC):
            raise EndOfFile(f"no end mark after {len(tail)} bytes")
        signed = tail[: -len(MAGIC) - 4]
        expected = int.from_bytes(tail[-len(MAGIC) - 4 : -len(MAGIC)], "little")
        if expected not in (0, zlib.crc32(signed)):
            raise ValueError("checksum of the index does not hold, after")
        source = BytesIO(tail)
        index = StreamReader(source, True, emit_chunks=True, record_size_limit=GREATEST_RECORD)
        places, groups, place = [], [], begin
        for one in index.records:
            listed = self._listed(one)
            places.extend([] if listed is None else [listed])
            if isinstance(one, records.SummaryOffset):
                groups.append(place)
                if not begin <= one.group_start <= place - one.group_length:
                    raise ValueError("a group of the index lies outside it, after")
            elif isinstance(one, records.Footer):
                starts = one.summary_start, one.summary_offset_start
                if starts[0] != begin or starts[1] not in (0, *groups[:1]):
                    raise ValueError("the footer places the index elsewhere, after")
            place = begin + source.tell()
        if source.tell() != len(tail):
            raise ValueError("bytes behind the footer, after")
        if sorted(map(_in_order, places)) != sorted(map(_in_order, self._places)):
            raise ValueError("the index does not list what the file holds, after")

    def _listed(self, one: records.McapRecord) -> tuple[object, ...] | None:
        """Return what a record of the index says of one of the data; None if it lists none."""
        if isinstance(one, records.ChunkIndex):
            times = one.message_start_time, one.message_end_time
            sizes = one.compressed_size, one.uncompressed_size
            place = one.chunk_start_offset, one.chunk_length
            return "chunk", *place, *times, *sizes, one.message_index_offsets
        if isinstance(one, (records.AttachmentIndex, records.MetadataIndex)):
            return _name(one).removesuffix("index"), one.offset, one.length, one.name
        if isinstance(one, (records.Schema, records.Channel)):
            self._declare(one)
        elif isinstance(one, records.Statistics) and not self._head_only:
            if one.channel_message_counts != self._counts:
                raise ValueError("the statistics count other messages, after")
        elif not isinstance(one, (records.Statistics, records.SummaryOffset, records.Footer)):
            raise ValueError(f"{_name(one)} in the index, after")
        return None

    def _damaged(self, what: str) -> InputError:
        return InputError(f"log '{self._path}': damaged ({what})")


def _in_order(place: tuple[object, ...]) -> str:
    """Return a place as a text, whatever the order of a chunk's channels."""
    return repr([sorted(one.items()) if isinstance(one, dict) else one for one in place])


DECLARATIONS: dict[int, Any] = {Opcode.SCHEMA: records.Schema, Opcode.CHANNEL: records.Channel}


def _name(one: records.McapRecord) -> str:
    """Return the kind of a record, and for a chunk its simulated time."""
    if isinstance(one, records.Chunk):
        begin, end = one.message_start_time, one.message_end_time
        return f"chunk of {begin * 1e-9:.1f} to {end * 1e-9:.1f} s"
    return type(one).__name__.lower()
