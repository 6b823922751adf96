"""MCAP file written on a thread of its own, so that compression does not delay an episode."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from typing import IO

from mcap.writer import CompressionType, Writer

from wayproof.harness.log.codec.container import PROFILE, Attachment, Metadata, Packet
from wayproof.harness.log.digest import CONTENT, RESULT, ContentDigest

Message = tuple[int, int, bytes, int]  # channel, time ns, data, sequence


class McapFile:
    """An MCAP file being written with the writer of the mcap package.

    Messages are collected up to the size of a chunk and passed to the thread one chunk after the
    other, so the bytes are those of a single thread. A failed write is raised as OSError by the
    next call that passes on a chunk, by `settle` or by `finish`.
    """

    def __init__(self, file: IO[bytes], library: str, chunk_size: int) -> None:
        """Write the file's head.

        Args:
            file: Empty file opened for writing; the caller closes it.
            library: Name and version of the writing program.
            chunk_size: A chunk is closed when its messages are larger, bytes.
        """
        self._file = file
        self._chunk_size = chunk_size
        self._writer = Writer(
            file, chunk_size, compression=CompressionType.ZSTD, enable_data_crcs=True
        )
        self._writer.start(profile=PROFILE.decode(), library=library)
        self._pool = ThreadPoolExecutor(1, "log")
        self._in_hand: Future[None] | None = None
        self._messages: list[Message] = []
        self._size = 0
        self._schemas: dict[str, int] = {}
        self._channels: dict[int, tuple[str, str]] = {}  # schema's name, topic
        self._digest = ContentDigest()  # of the content, in file order

    def add_metadata(self, name: str, fields: Mapping[str, str]) -> None:
        """Write named text fields, before the messages of the open chunk."""
        self.settle()
        self._digest.add(Metadata(name, dict(fields)))
        self._writer.add_metadata(name, dict(fields))

    def add_result(self, fields: Mapping[str, str]) -> None:
        """Write the result after all messages so far, with the digest of the content of the file.

        Anything added later invalidates the digest.
        """
        self.hand_on()
        self.settle()
        self._digest.add(Metadata(RESULT, dict(fields)))
        self._writer.add_metadata(RESULT, {**fields, CONTENT: self._digest.text()})

    def add_attachment(self, name: str, media_type: str, content: bytes) -> None:
        """Write a named file, before the messages of the open chunk."""
        self.settle()
        self._digest.add(Attachment(name, content))
        self._writer.add_attachment(0, 0, name, media_type, content)

    def add_channel(self, topic: str, schema_name: str, schema: bytes) -> int:
        """Declare a channel of protobuf messages and its schema; return its number."""
        self.settle()
        known = self._schemas.get(schema_name)
        if known is None:
            known = self._writer.register_schema(schema_name, "protobuf", schema)
            self._schemas[schema_name] = known
        channel = self._writer.register_channel(topic, "protobuf", known)
        self._channels[channel] = schema_name, topic
        return channel

    def add_message(self, channel: int, time_ns: int, data: bytes, sequence: int) -> None:
        """Append a message to the open chunk."""
        self._messages.append((channel, time_ns, data, sequence))
        self._size += len(data)
        if self._size > self._chunk_size:
            self.hand_on()

    def hand_on(self) -> None:
        """Close the open chunk and pass it to the thread once the one before is written."""
        self.settle()
        if self._messages:
            messages, self._messages, self._size = self._messages, [], 0
            try:
                self._in_hand = self._pool.submit(self._write, messages)
            except RuntimeError:  # Python is shutting down, and gives threads no more work
                self._write(messages)

    def settle(self) -> None:
        """Wait until everything passed on is with the operating system."""
        if self._in_hand is not None:
            in_hand, self._in_hand = self._in_hand, None
            in_hand.result()

    def size(self) -> int:
        """Write everything so far and return the size of the file, bytes."""
        self.hand_on()
        self.settle()
        return self._file.tell()

    def finish(self) -> None:
        """Write the rest and the index."""
        self.hand_on()
        self.settle()
        self._writer.finish()
        self._file.flush()
        self.close()

    def close(self) -> None:
        """End the thread."""
        self._pool.shutdown()

    def _write(self, messages: list[Message]) -> None:
        """Write and flush, on the thread."""
        for channel, time_ns, data, sequence in messages:
            self._digest.add(Packet(*self._channels[channel], time_ns, data))
            self._writer.add_message(channel, time_ns, data, time_ns, sequence)
        self._writer.flush()
        self._file.flush()
