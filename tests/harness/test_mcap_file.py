"""The writer of MCAP files: what the mcap package's own reader finds, and how it fails."""

import io
import threading
import zlib

import pytest
import zstandard
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader

from harness.container import Packet, walk
from harness.log import LogWriter
from harness.mcap_file import McapFile
from harness.schema import wayproof_pb2 as pb


def written(chunk_size=200, level=2, flush=()):
    file = io.BytesIO()
    writer = McapFile(file, "a writer", chunk_size, level)
    writer.add_metadata("run", {"a": "b"})
    writer.add_attachment("config.json", "application/json", b"{}")
    channels = [writer.add_channel(topic, "Some.Kind", b"schema") for topic in ("/one", "/two")]
    for k in range(40):
        writer.add_message(channels[k % 2], 10 * k, bytes([k]) * 30, k)
        if k in flush:
            writer.hand_on()
    writer.add_metadata("result", {"c": "d"})
    writer.finish()
    return file.getvalue()


def test_another_reader_finds_what_was_written():
    data = written()
    reader = make_reader(io.BytesIO(data), validate_crcs=True)
    summary = reader.get_summary()
    assert len(summary.chunk_indexes) > 3
    assert summary.statistics.channel_message_counts == {1: 20, 2: 20}
    assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (0, 390)
    assert [one.name for one in summary.schemas.values()] == ["Some.Kind"]  # one for both channels
    found = [(c.topic, m.log_time, m.sequence, m.data) for _, c, m in reader.iter_messages()]
    assert found == [(("/one", "/two")[k % 2], 10 * k, k, bytes([k]) * 30) for k in range(40)]
    two = [
        m.sequence for _, _, m in reader.iter_messages("/two", starting_at=100, ending_before=200)
    ]  # by the index
    assert two == [11, 13, 15, 17, 19]
    assert [one.name for one in reader.iter_metadata()] == ["run", "result"]
    assert [one.data for one in reader.iter_attachments()] == [b"{}"]
    straight = NonSeekingReader(io.BytesIO(data), validate_crcs=True)
    assert len(list(straight.iter_messages(log_time_order=False))) == 40


def test_the_same_bytes_each_time():
    assert len({written() for _ in range(5)}) == 1
    assert written(flush=(3, 7)) != written()


def test_chunks_are_those_of_the_standard(tmp_path):
    """Their sizes and checksums, read by the layout in the specification."""
    path = tmp_path / "a.mcap"
    path.write_bytes(written(chunk_size=500))
    data = path.read_bytes()
    place, sizes = 8, []
    while data[place] != 0x0F:
        length = int.from_bytes(data[place + 1 : place + 9], "little")
        if data[place] == 0x06:
            body = data[place + 9 : place + 9 + length]
            assert body[28:36] == b"\x04\0\0\0zstd"
            plain = zstandard.decompress(body[44:])
            assert zlib.crc32(plain) == int.from_bytes(body[24:28], "little")
            sizes.append(len(plain))
        place += 9 + length
    assert all(500 < size < 500 + 9 + 22 + 30 + 100 for size in sizes[:-1])
    assert sum(isinstance(one, Packet) for one in walk(path)) == 40


class Full(io.BytesIO):
    """A file that takes so many bytes."""

    def __init__(self, left):
        super().__init__()
        self.left = left

    def write(self, data):
        self.left -= len(data)
        if self.left < 0:
            raise OSError(28, "No space left on device")
        return super().write(data)


def test_what_the_thread_cannot_write_is_raised_by_the_next_call():
    writer = McapFile(Full(200), "a writer", 100, 2)
    channel = writer.add_channel("/one", "Some.Kind", b"schema")
    writer.add_message(channel, 0, bytes(range(200)), 0)
    with pytest.raises(OSError, match="No space left"):
        writer.add_message(channel, 1, bytes(range(200)), 1)
    writer.close()


def test_a_closed_log_leaves_no_thread(tmp_path):
    before = threading.active_count()
    with LogWriter(tmp_path / "a.mcap", b"{}", b"[]", "<mujoco/>") as log:
        log.write("/pose", pb.Pose(), 0)
    log = LogWriter(tmp_path / "b.mcap", b"{}", b"[]", "<mujoco/>")
    log.write("/pose", pb.Pose(), 0)
    log.finish({})
    assert threading.active_count() == before


@pytest.mark.parametrize("period_ms", [20, 100, 200, 300, 700, 1000, 1500])
def test_an_instant_is_in_the_file_within_a_second(tmp_path, period_ms):
    """Or within the time between two instants, where that is longer."""
    period = period_ms * 1_000_000
    log = LogWriter(tmp_path / "a.mcap", b"{}", b"{}", "<mujoco/>")
    for k in range(1, 30):
        log.write("/pose", pb.Pose(sequence=k), k * period)
        log.write("/decision", pb.Decision(sequence=k), k * period)
        found = [m.log_time for m in readable(log.partial_path)]
        oldest_lost = (max(found) if found else 0) + period
        assert k * period - oldest_lost <= max(1_000_000_000 - period, 0)
    log.discard()


def readable(path):
    reader = NonSeekingReader(io.BytesIO(path.read_bytes()))
    try:
        for _, _, message in reader.iter_messages(log_time_order=False):
            yield message
    except EndOfFile:
        return
