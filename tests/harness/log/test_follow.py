"""A log followed while it is being written."""

import threading
from pathlib import Path

import pytest

from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import Attachment, Metadata, Packet, walk
from wayproof.harness.log.codec.messages import decode, is_ours
from wayproof.harness.log.follow import UNDER_WAY, followed, partial_name
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.writer import LogWriter

LONGEST_S = 30.0


@pytest.fixture(scope="module")
def source(recorded):
    return Path(recorded("empty", "drone", 1, "episode.time_limit=1").log)


class Copying:
    """A log that is written again, message by message."""

    def __init__(self, source, path):
        log = open_log(source)
        items = list(walk(source))
        files = {one.name: one.data for one in items if isinstance(one, Attachment)}
        self.result = next(
            one.fields for one in items if isinstance(one, Metadata) and one.name == "result"
        )
        self.writer = LogWriter(path, files["config.json"], files["mission.json"], log.scene)
        self.packets = [one for one in items if isinstance(one, Packet) and is_ours(one)]
        self.source = source

    def write(self, decisions):
        """Write up to the truth after so many decisions, and hand it on."""
        seen = 0
        while self.packets and seen < decisions:
            packet = self.packets.pop(0)
            self.writer.write(packet.topic, decode(packet, self.source), packet.time_ns)
            seen += packet.topic == "/truth"
        self.writer.flush()

    def finish(self):
        self.write(10**6)
        self.writer.finish({key: value for key, value in self.result.items() if key != "content"})


def numbers(records):
    return [record.decision.sequence for record, _ in records]


def test_decisions_come_while_the_log_is_written(source, tmp_path):
    path = tmp_path / "x.mcap"
    copying = Copying(source, path)
    copying.write(3)
    with followed(path) as log:
        assert log.result == {"outcome": UNDER_WAY}
        assert log.under_way
        records = log.records_with_truth()
        assert [next(records)[0].decision.sequence for _ in range(3)] == [0, 1, 2]
        assert not path.exists()
        copying.write(2)
        assert [next(records)[0].decision.sequence for _ in range(2)] == [3, 4]
        copying.finish()
        rest = numbers(records)
        whole = open_log(source)
        assert [0, 1, 2, 3, 4, *rest] == numbers(whole.records_with_truth())
        assert log.finished().result["chain"] == whole.result["chain"]


def test_a_reader_waits_for_the_next_decision(source, tmp_path):
    copying = Copying(source, tmp_path / "x.mcap")
    copying.write(1)
    with followed(tmp_path / "x.mcap") as log:
        got = threading.Event()
        records = log.records_with_truth()
        next(records)
        reader = threading.Thread(target=lambda: (next(records), got.set()), daemon=True)
        reader.start()
        assert not got.wait(0.3)
        copying.write(1)
        assert got.wait(LONGEST_S)
        copying.finish()


def test_a_writer_that_ends_without_a_result_ends_the_log(source, tmp_path):
    path = tmp_path / "x.mcap"
    copying = Copying(source, path)
    copying.write(4)
    copying.writer.close()
    with followed(partial_name(path)) as log:
        assert numbers(log.records_with_truth()) == [0, 1, 2, 3]
        assert log.finished() is log


def test_a_damaged_chunk_is_no_end(source, tmp_path):
    path = tmp_path / "x.mcap"
    copying = Copying(source, path)
    copying.write(5)
    copying.writer.close()
    partial = partial_name(path)
    content = bytearray(partial.read_bytes())
    content[len(content) * 4 // 5] ^= 0xFF  # in the chunk, the last but its index
    partial.write_bytes(content)
    with pytest.raises(InputError, match="damaged"), followed(path) as log:
        numbers(log.records_with_truth())


def test_a_log_that_nobody_writes_is_bad_input(source, tmp_path):
    with pytest.raises(InputError, match="expected one that is being written"):
        followed(tmp_path / "none.mcap").__enter__()
    path = tmp_path / "x.mcap"
    Copying(source, path).writer.close()  # a head alone
    with pytest.raises(InputError, match="ended before the first decision"):
        followed(path).__enter__()
