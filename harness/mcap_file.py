"""Writing an MCAP file whose chunks are compressed and written by a thread of their own.

The mcap package gives the records' layouts; its own writer compresses at one level only, and while
it does the episode waits. Here a finished chunk goes to the thread, which checks, compresses and
writes one after the other: the bytes are those that one thread alone would write.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import IO

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from harness.container import MAGIC

COMPRESSION = b"zstd"

MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, time logged and published
CHUNK = struct.Struct("<BQQQQII4sQ")  # opcode, length, first and last time, size, crc, "zstd", size
INDEX = struct.Struct("<BQHI")  # opcode, length, channel, size
FOOTER = struct.Struct("<BQQQ")  # opcode, length, where the summary and its offsets start


@dataclass
class Chunk:
    """Records that are compressed together.

    Attributes:
        parts: Their bytes, piece by piece.
        size: Of these, bytes.
        places: Time and offset of each message, by channel.
        times: First and last time of a message, ns; none without one.
    """

    parts: list[bytes] = field(default_factory=list)
    size: int = 0
    places: dict[int, list[int]] = field(default_factory=dict)
    times: tuple[int, int] | None = None

    def add(self, *parts: bytes) -> None:
        """Append a record."""
        self.parts += parts
        self.size += sum(map(len, parts))


class McapFile:
    """One MCAP file in the making.

    What the thread cannot write is raised as OSError by the call that next has to do with it:
    whatever hands on a chunk, `settle` or `finish`.
    """

    def __init__(self, file: IO[bytes], library: str, chunk_size: int, level: int) -> None:
        """Write the file's head.

        Args:
            file: Opened for writing, empty; it stays the caller's to close.
            library: Name and version of what writes.
            chunk_size: A chunk is closed when it is larger, bytes.
            level: Of zstd.
        """
        self._file = file
        self._chunk_size = chunk_size
        self._compressor = zstandard.ZstdCompressor(level=level)
        self._pool = ThreadPoolExecutor(1, "log")
        self._in_hand: Future[None] | None = None
        self._chunk = Chunk()
        self._offset = self._checksum = 0
        self._schemas: dict[str, Schema] = {}
        self._channels: list[Channel] = []
        self._counts: dict[int, int] = {}
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._put(MAGIC, _record(Header("wayproof", library)))

    def add_metadata(self, name: str, fields: Mapping[str, str]) -> None:
        """Write named text fields, before the messages of the open chunk."""
        self.settle()
        data = _record(Metadata(name=name, metadata=dict(fields)))
        self._metadata.append(MetadataIndex(self._offset, len(data), name))
        self._put(data)

    def add_attachment(self, name: str, media_type: str, content: bytes) -> None:
        """Write a named file, before the messages of the open chunk."""
        self.settle()
        data = _record(Attachment(0, 0, name, media_type, content))
        self._attachments.append(
            AttachmentIndex(self._offset, len(data), 0, 0, len(content), name, media_type)
        )
        self._put(data)

    def add_channel(self, topic: str, schema_name: str, schema: bytes) -> int:
        """Declare a channel of protobuf messages and its schema; returns the channel's number."""
        known = self._schemas.get(schema_name)
        if known is None:
            known = Schema(
                id=len(self._schemas) + 1, name=schema_name, encoding="protobuf", data=schema
            )
            self._schemas[schema_name] = known
            self._chunk.add(_record(known))
        channel = Channel(
            id=len(self._channels) + 1,
            topic=topic,
            message_encoding="protobuf",
            schema_id=known.id,
            metadata={},
        )
        self._channels.append(channel)
        self._chunk.add(_record(channel))
        return channel.id

    def add_message(self, channel: int, time_ns: int, data: bytes, sequence: int) -> None:
        """Append a message to the open chunk."""
        chunk = self._chunk
        chunk.places.setdefault(channel, []).extend((time_ns, chunk.size))
        first, last = chunk.times or (time_ns, time_ns)
        chunk.times = min(first, time_ns), max(last, time_ns)
        length = MESSAGE.size - 9 + len(data)
        head = MESSAGE.pack(Opcode.MESSAGE, length, channel, sequence, time_ns, time_ns)
        chunk.add(head, data)
        if chunk.size > self._chunk_size:
            self.hand_on()

    def hand_on(self) -> None:
        """Close the open chunk and let the thread write it, once the one before is written."""
        self.settle()
        if self._chunk.times is not None:
            self._in_hand = self._pool.submit(self._write, self._chunk)
            self._chunk = Chunk()

    def settle(self) -> None:
        """Wait until all that was handed on is with the operating system."""
        if self._in_hand is not None:
            in_hand, self._in_hand = self._in_hand, None
            in_hand.result()

    def finish(self) -> None:
        """Write what is left, and the index."""
        self.hand_on()
        self.settle()
        self._put(_record(DataEnd(self._checksum)))
        begin = self._offset
        groups: list[Sequence[McapRecord]] = [[*self._schemas.values()], self._channels]
        groups += [[self._statistics()], self._chunks, self._attachments, self._metadata]
        summary = bytearray()
        offsets = b""
        for group in groups:
            data = b"".join(map(_record, group))
            if data:
                offset = SummaryOffset(data[0], begin + len(summary), len(data))
                offsets += _record(offset)
            summary += data
        offset_begin = begin + len(summary)
        summary += offsets
        foot = FOOTER.pack(Opcode.FOOTER, 20, begin, offset_begin)
        checksum = zlib.crc32(foot, zlib.crc32(summary))
        self._put(bytes(summary), _record(Footer(begin, offset_begin, checksum)), MAGIC)
        self._file.flush()
        self.close()

    def close(self) -> None:
        """End the thread."""
        self._pool.shutdown()

    def _write(self, chunk: Chunk) -> None:
        """Compress and write a chunk and its index; the thread's work."""
        assert chunk.times is not None
        data = b"".join(chunk.parts)
        packed = self._compressor.compress(data)
        length = CHUNK.size - 9 + len(packed)
        checksum = zlib.crc32(data)
        size = len(COMPRESSION), COMPRESSION, len(packed)
        head = CHUNK.pack(Opcode.CHUNK, length, *chunk.times, len(data), checksum, *size)
        begin = self._offset
        self._put(head, packed)
        end = self._offset
        places = {}
        for channel, numbers in chunk.places.items():
            places[channel] = self._offset
            size_of = 8 * len(numbers)
            index = INDEX.pack(Opcode.MESSAGE_INDEX, INDEX.size - 9 + size_of, channel, size_of)
            self._put(index, struct.pack(f"<{len(numbers)}Q", *numbers))
            self._counts[channel] = self._counts.get(channel, 0) + len(numbers) // 2
        self._chunks.append(
            ChunkIndex(
                chunk_length=end - begin,
                chunk_start_offset=begin,
                compression=COMPRESSION.decode(),
                compressed_size=len(packed),
                message_end_time=chunk.times[1],
                message_index_length=self._offset - end,
                message_index_offsets=places,
                message_start_time=chunk.times[0],
                uncompressed_size=len(data),
            )
        )
        self._file.flush()

    def _put(self, *parts: bytes) -> None:
        for part in parts:
            self._checksum = zlib.crc32(part, self._checksum)
            self._file.write(part)
            self._offset += len(part)

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_end_time=max((one.message_end_time for one in self._chunks), default=0),
            message_start_time=min((one.message_start_time for one in self._chunks), default=0),
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )


def _record(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()
    return data
