"""The writer of MCAP files, and its failures."""

import io
import struct
import threading

import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader, make_reader

from wayproof.harness.log.codec.mcap_file import McapFile
from wayproof.harness.log.writer import LogWriter
from wayproof.harness.schema import wayproof_pb2 as pb


def written(chunk_size=200, flush=()):
    file = io.BytesIO()
    writer = McapFile(file, "a writer", chunk_size)
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


def test_another_reader_reads_the_file():
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


def test_a_failed_write_is_raised_by_the_next_call():
    writer = McapFile(Full(200), "a writer", 100)
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


@pytest.mark.parametrize("period_ms", [20, 300, 1500])
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
    log.close()


def readable(path):
    reader = NonSeekingReader(io.BytesIO(path.read_bytes()))
    try:
        for _, _, message in reader.iter_messages(log_time_order=False):
            yield message
    except (EndOfFile, struct.error):  # the writer's thread is in the middle of a record
        return
