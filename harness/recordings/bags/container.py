"""Messages of the files of a bag, still encoded, in the order of the file.

MCAP and ROS 1 are read from the first byte on, without their index: a file that was not closed is
read as well, and the order tells the runs of a bag apart.
"""

from __future__ import annotations

import bz2
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from io import BytesIO
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO, NamedTuple

import zstandard
from mcap.records import Channel, Chunk, DataEnd, Message, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from wayproof.harness.errors import InputError
from wayproof.harness.recordings.options import Broken, Faults, unreadable

GREATEST_RECORD = 2**28
"""Maximum size of a record or an unpacked chunk, bytes; a cloud of a million points takes 2^25."""

GREATEST_RATIO, LEAST_UNPACKED = 1024, 2**20
"""Maximum size of an unpacked chunk: its packed size times the first, plus the second, bytes."""

LEAST_MESSAGES, LEAST_BYTES = 200_000, 4
"""Number of messages allowed in any bag, and bytes of the bag for each one beyond it."""

MOST_TOPICS = 10_000

CUT = "bag: cut short"
DAMAGED = "bag: damaged chunk or record"

ROS1_MESSAGE, ROS1_CHUNK, ROS1_CONNECTION = 2, 5, 7
"""Values of the field `op` of the records of ROS 1 that are read."""

TABLES = "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('topics','messages')"
TOPICS = "SELECT id, name, type, serialization_format FROM topics ORDER BY id LIMIT ?"
MESSAGES = "SELECT topic_id, timestamp, data FROM messages ORDER BY rowid"


class RawMessage(NamedTuple):
    """A message, still encoded.

    Attributes:
        topic: Topic.
        type: Name of its type, as `sensor_msgs/msg/LaserScan`.
        encoding: `cdr` or `ros1`.
        logged_ns: Time at which it was recorded, ns.
        data: Its bytes.
    """

    topic: str
    type: str
    encoding: str
    logged_ns: int
    data: bytes


def files_of(path: Path) -> list[Path]:
    """Return the files of a bag: the one, or those of a folder by their numbers.

    A folder is a bag of ROS 2, or holds the parts of one of ROS 1 (`rosbag record --split`).
    """
    if path.is_file():
        return [path]
    inside = [one for one in path.iterdir() if one.is_file()]
    found = [one for one in inside if one.suffix in (".mcap", ".db3")]
    found = found or [one for one in inside if one.suffix == ".bag"]
    return sorted(found, key=lambda one: (len(one.name), one.name))


def container_of(path: Path) -> Container | None:
    """Return the reader of a file by its first bytes."""
    with path.open("rb") as file:
        head = file.read(16)
    return next((read for magic, read in CONTAINERS.items() if head.startswith(magic)), None)


def messages_of(files: Sequence[Path], faults: Faults) -> Iterator[RawMessage]:
    """Yield the messages of all files of a bag, in their order; count damaged and cut off ones.

    Raises:
        InputError: There are more than the files' sizes can account for, or a library is missing.
    """
    left = LEAST_MESSAGES + sum(one.stat().st_size for one in files) // LEAST_BYTES
    for path in files:
        read = container_of(path)
        for raw in read(path, faults) if read else ():
            left -= 1
            if left < 0:
                raise InputError("more messages than its size accounts for")
            try:
                if raw.data[:4] == zstandard.FRAME_HEADER:  # `compression_mode: message`
                    raw = raw._replace(data=unpack("zstd", raw.data))
                yield raw
            except Broken:
                faults[DAMAGED] += 1


def _mcap(path: Path, faults: Faults) -> Iterator[RawMessage]:
    schemas: dict[int, str] = {}
    channels: dict[int, tuple[str, str, str]] = {}
    with path.open("rb") as file:
        stream = StreamReader(file, emit_chunks=True, record_size_limit=GREATEST_RECORD)
        try:
            for record in stream.records:
                if isinstance(record, DataEnd):
                    return
                for one in _parts(record, faults) if isinstance(record, Chunk) else (record,):
                    if isinstance(one, Schema):
                        schemas[one.id] = ros2_type(one.name)
                    elif isinstance(one, Channel) and len(channels) < MOST_TOPICS:
                        kind = schemas.get(one.schema_id, "")
                        channels[one.id] = same_path(one.topic), kind, one.message_encoding
                    elif isinstance(one, Message) and one.channel_id not in channels:
                        faults[DAMAGED] += 1
                    elif isinstance(one, Message) and channels[one.channel_id][2] in ENCODINGS:
                        yield RawMessage(*channels[one.channel_id], one.log_time, one.data)
        except Exception:  # the library fails in many ways on bytes of no record
            faults[CUT] += 1


def _parts(chunk: Chunk, faults: Faults) -> list[Any]:
    """Return the records of a chunk; none of one that is damaged."""
    try:
        chunk.data = unpack(chunk.compression, chunk.data, chunk.uncompressed_size)
        chunk.compression = ""
        return breakup_chunk(chunk, validate_crc=True)
    except InputError:
        raise
    except Exception:  # as above
        faults[DAMAGED] += 1
        return []


def _ros1(path: Path, faults: Faults) -> Iterator[RawMessage]:
    try:
        from rosbags.rosbag1.reader import Header, ReaderError, read_bytes, read_uint32
    except ImportError:
        raise InputError(NO_ROSBAGS) from None
    topics: dict[int, tuple[str, str]] = {}

    def records(source: BinaryIO, size: int, *, is_chunk: bool) -> Iterator[RawMessage]:
        while source.tell() < size:
            header = Header.read(source)
            length = read_uint32(source)
            if length > GREATEST_RECORD:
                raise Broken(f"a record of {length} bytes")
            body = read_bytes(source, length)
            try:
                kind = header.get_uint8("op")
                if kind == ROS1_CHUNK and not is_chunk:
                    size_of_it = header.get_uint32("size")
                    data = unpack(header.get_string("compression"), body, size_of_it)
                    yield from records(BytesIO(data), len(data), is_chunk=True)
                elif kind == ROS1_CONNECTION and len(topics) < MOST_TOPICS:
                    prefixed = len(body).to_bytes(4, "little") + body
                    type_ = Header.read(BytesIO(prefixed)).get_string("type")
                    topic = same_path(header.get_string("topic"))
                    topics[header.get_uint32("conn")] = topic, ros2_type(type_)
                elif kind == ROS1_MESSAGE:
                    named = topics[header.get_uint32("conn")]
                    yield RawMessage(*named, "ros1", header.get_time("time"), body)
            except (Broken, ReaderError, KeyError, ValueError):
                faults[DAMAGED] += 1

    with path.open("rb") as file:
        file.read(len(ROS1_MAGIC))
        try:
            yield from records(file, path.stat().st_size, is_chunk=False)
        except (Broken, ReaderError, ValueError, MemoryError):
            faults[CUT] += 1


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    """Open a file, or where a killed recorder left a `-wal`, a copy on disk that both make up."""
    log = path.with_name(f"{path.name}-wal")
    if not log.is_file() or log.stat().st_size == 0:
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?immutable=1", uri=True)) as base:
            yield base
        return
    with TemporaryDirectory() as folder:
        for one in (path, log):
            copyfile(one, Path(folder, one.name))
        with closing(sqlite3.connect(Path(folder, path.name))) as base:
            yield base


def _sqlite(path: Path, faults: Faults) -> Iterator[RawMessage]:
    """Yield the messages of tables, never of a view that the file defines."""
    try:
        with _opened(path) as base:
            base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, GREATEST_RECORD)
            base.execute("PRAGMA trusted_schema = OFF")
            if base.execute(TABLES).fetchone() != (2,):
                return
            topics = {
                number: (same_path(topic), ros2_type(type_), encoding)
                for number, topic, type_, encoding in base.execute(TOPICS, (MOST_TOPICS,))
                if all(isinstance(text, str) for text in (topic, type_, encoding))
            }
            for number, logged_ns, data in base.execute(MESSAGES):
                if number not in topics or type(logged_ns) is not int or type(data) is not bytes:
                    faults[DAMAGED] += 1
                else:
                    yield RawMessage(*topics[number], logged_ns, data)
    except (sqlite3.Error, OverflowError, UnicodeDecodeError):
        faults[CUT] += 1


def _ulog(path: Path, faults: Faults) -> Iterator[RawMessage]:
    """Yield the topics of PX4's own log as the messages that PX4 sends of them."""
    try:
        from pyulog import ULog
    except ImportError:
        raise InputError(
            "ULog: pyulog is not installed: pip install pyulog (the extra 'recordings')"
        ) from None
    from wayproof.harness.recordings.bags.vendors.px4 import messages_of_ulog

    try:
        log = ULog(str(path))
    except Exception as error:  # it fails in many ways on bytes of no ULog
        raise InputError(
            f"cannot be read as ULog ({type(error).__name__}: {' '.join(str(error).split())[:100]})"
        ) from None
    faults["bag: dropout while it was logged"] += len(log.dropouts)
    faults[DAMAGED] += bool(log.file_corruption)
    found = []
    for one in log.data_list:
        topic = one.name + f"_{one.multi_id}" * (one.multi_id > 0)
        try:
            for type_, stamp, data in messages_of_ulog(one.name, one.data):
                found.append(RawMessage(topic, type_, "cdr", stamp, data))
        except Broken as error:
            faults[unreadable(faults, error)] += 1
    yield from sorted(found, key=lambda raw: raw.logged_ns)


def unpack(compression: str, packed: bytes, size: int | None = None) -> bytes:
    """Decompress a chunk that states its size, or a message that does not.

    Raises:
        Broken: It is larger than its packed bytes can account for, not of that size, or damaged.
    """
    most = min(GREATEST_RECORD, LEAST_UNPACKED + GREATEST_RATIO * len(packed))
    if size is not None and size > most:
        raise Broken(f"a chunk of {len(packed)} bytes that unpacks to {size}")
    wanted = (most if size is None else size) + 1
    try:
        if compression in ("", "none"):
            data = packed
        elif compression == "zstd":
            data = zstandard.ZstdDecompressor().stream_reader(packed).read(wanted)
        elif compression == "bz2":
            data = bz2.BZ2Decompressor().decompress(packed, wanted)
        elif compression == "lz4":
            from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

            data = LZ4FrameDecompressor().decompress(packed, max_length=wanted)
        else:
            raise Broken(f"compression '{compression[:20]}'")
    except ImportError:
        raise InputError("lz4: not installed, expected the extra 'recordings'") from None
    except (zstandard.ZstdError, OSError, EOFError, ValueError, RuntimeError, MemoryError):
        raise Broken(f"{compression} data that is damaged") from None
    if len(data) > most or (size is not None and len(data) != size):
        raise Broken(f"{compression} data that does not unpack to its size")
    return data


def ros2_type(name: str) -> str:
    """Return the name of a type as ROS 2 writes it: `package/msg/Name`."""
    package, _, rest = name.partition("/")
    return name if rest.startswith("msg/") else f"{package}/msg/{rest}"


def same_path(topic: str) -> str:
    """Return a topic without repeated slashes."""
    return "/" * topic.startswith("/") + "/".join(part for part in topic.split("/") if part)


NO_ROSBAGS = "ROS bags: rosbags is not installed: pip install rosbags (the extra 'recordings')"
ENCODINGS = ("cdr", "ros1")
ROS1_MAGIC = b"#ROSBAG V2.0\n"
Container = Callable[[Path, Faults], Iterator[RawMessage]]
CONTAINERS: dict[bytes, Container] = {
    b"\x89MCAP0\r\n": _mcap,
    ROS1_MAGIC: _ros1,
    b"SQLite format 3\x00": _sqlite,
    b"ULog\x01\x12\x35": _ulog,
}
"""First bytes of a file -> reader of its messages."""
