"""MCAP records of whole, damaged and hostile files."""

import re
import zlib

import numpy as np
import pytest
import zstandard

from tests.harness.log.conftest import damaged
from tests.tools.soak.hostile_logs import (
    chunk,
    declared,
    message,
    record,
    with_chunks,
)
from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import (
    GREATEST_RECORD,
    HEAD,
    MAGIC,
    Attachment,
    Metadata,
    Packet,
    walk,
)
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.decision_messages import MOST_SWEEPS, DecisionMessages
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.writer import LogWriter, file_descriptor_set
from wayproof.harness.schema import wayproof_pb2 as pb


def test_the_parser_reads_what_the_writer_wrote(tmp_path):
    with LogWriter(tmp_path / "a.mcap", b"{}", b"[]", "<mujoco/>") as log:
        log.write("/pose", pb.Pose(sequence=3), 7)
        log.note("fork", {"at": "1"})
        log.finish({"outcome": "success"})
    items = list(walk(tmp_path / "a.mcap"))
    attached = {one.name: one.data for one in items if isinstance(one, Attachment)}
    assert attached == {"config.json": b"{}", "mission.json": b"[]", "scene.xml": b"<mujoco/>"}
    names = [one.name for one in items if isinstance(one, Metadata)]
    assert names == ["run", "fork", "result"]
    data = pb.Pose(sequence=3).SerializeToString()
    assert [one for one in items if isinstance(one, Packet)] == [
        Packet("wayproof.Pose", "/pose", 7, data, file_descriptor_set(pb.Pose.DESCRIPTOR))
    ]


def test_every_flipped_bit_is_detected(source, tmp_path):
    """A bit in each stretch of the file, the index behind the data among them."""
    data = source.read_bytes()
    rng = np.random.default_rng(0)
    places = np.unique(np.concatenate([rng.integers(0, len(data), 150), np.arange(9), [-1]]))
    for place in places:
        spoilt = bytearray(data)
        spoilt[place] ^= 1 << int(rng.integers(8))
        path = damaged(tmp_path, spoilt)
        with pytest.raises(InputError, match=r"^log '.*': .+$"):
            read_all(path)


def read_all(path):
    open_log(path)
    return list(read_messages(path))


def test_a_flip_in_a_chunk_is_located(source, tmp_path):
    data = bytearray(source.read_bytes())
    offsets = {}
    place = len(MAGIC)
    while place < len(data) - len(MAGIC):
        opcode, length = HEAD.unpack_from(data, place)
        offsets.setdefault(opcode, place)
        place += HEAD.size + length
    chunk = offsets[6]
    data[chunk + 1000] ^= 1
    with pytest.raises(InputError, match=rf"chunk of 0\.0 to 0\.\d s at byte {chunk}\)"):
        list(read_messages(damaged(tmp_path, data)))


def bare_chunk(data, size, compression="zstd"):
    """A file of one chunk that says to unpack to `size` bytes."""
    packed = zstandard.compress(data) if compression == "zstd" else data
    name = compression.encode()
    body = bytes(16) + size.to_bytes(8, "little") + zlib.crc32(data).to_bytes(4, "little")
    body += len(name).to_bytes(4, "little") + name + len(packed).to_bytes(8, "little") + packed
    return MAGIC + HEAD.pack(6, len(body)) + body


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (MAGIC + HEAD.pack(1, 2**62), "length 4611686018427387904 that exceeds limit"),
        (MAGIC + HEAD.pack(12, 1000) + b"\xff\x00\x00\x00ab", "2 of 255 bytes, record at byte 8"),
        (bare_chunk(bytes(100), 2**40), "unpacks to 1099511627776 bytes"),
        (bare_chunk(bytes(2**20), 1000), "unpacks to 1048576 bytes, expected 1000"),
        (bare_chunk(bytes(2**22), 2**22), "over 4096 times"),
        (bare_chunk(b"", 0, "lz4"), "compression 'lz4', expected 'zstd' or none"),
        (MAGIC + HEAD.pack(12, 4) + b"\xff\xff\xff\xff", "a field of 4294967295 bytes"),
        (MAGIC + HEAD.pack(5, 22) + bytes(22), "a message outside a chunk"),
    ],
)
def test_sizes_are_checked_before_anything_of_that_size_is_made(tmp_path, data, said):
    path = damaged(tmp_path, data)
    with pytest.raises(InputError, match=said.replace("(", r"\(")):
        list(walk(path))
    assert GREATEST_RECORD == 64 * 2**20


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (record(0x7F, b"") * 100_000, "records in chunks"),
        (declared(99, "a", "b") * 50_000, "records in chunks"),
        (declared(99, "a", "b") + message(99, b"") * 100_000, "records in chunks"),
        (
            declared(99, "wayproof.Decision", "/decision") + message(99, bytes(5 * 2**20)),
            "bytes of messages other than sweeps",
        ),
    ],
)
def test_records_and_their_bytes_are_counted_before_they_are_made(tmp_path, data, said):
    """Chunks of empty messages compress by thousands: a small file could fill the memory."""
    path = with_chunks([chunk(data)], tmp_path / "flood.mcap")
    with pytest.raises(InputError, match=re.escape(said)):
        list(walk(path))


def test_sweeps_of_one_decision_are_bounded():
    given = DecisionMessages()
    for _ in range(MOST_SWEEPS):
        given.take(pb.Sweep())
    with pytest.raises(InputError, match="over 256 sweeps for one decision"):
        given.take(pb.Sweep())
