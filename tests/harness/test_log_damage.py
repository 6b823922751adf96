"""Logs that are broken, cut short, or written by someone who means harm."""

import contextlib
import hashlib
import io
import itertools
import json
import re
import resource
import signal
import zlib
from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap.writer import Writer

from wayproof.harness.bench.maintain.small_log import COMMITTED, committed_name
from wayproof.harness.bench.soak.child import in_child
from wayproof.harness.bench.soak.hostile_logs import (
    NUMBER,
    chunk,
    declared,
    message,
    record,
    with_chunks,
)
from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.log.codec import container
from wayproof.harness.log.codec.container import (
    GREATEST_RECORD,
    HEAD,
    MAGIC,
    Attachment,
    Metadata,
    Packet,
    walk,
)
from wayproof.harness.log.codec.messages import decode, read_messages
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.recover import recover
from wayproof.harness.log.writer import FLUSH_PERIOD_NS, LogWriter, digest_name
from wayproof.harness.replay.audit import audit
from wayproof.harness.replay.replay import replay
from wayproof.harness.schema import wayproof_pb2 as pb


@pytest.fixture(scope="module")
def source():
    return COMMITTED / committed_name()


def damaged(tmp_path, data):
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    return path


def test_what_the_writer_wrote_is_what_the_walk_finds(tmp_path):
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
        Packet("wayproof.Pose", "/pose", 7, data)
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


@pytest.mark.parametrize("share", [0.6, 0.95, 0.999])
def test_what_is_whole_before_a_cut_is_recovered(source, tmp_path, share):
    data = source.read_bytes()
    path = damaged(tmp_path, data[: int(share * len(data))])
    path = path.rename(tmp_path / "cut.mcap.partial")
    before = [one.chain for one in open_log(source).decisions()]
    if share < 0.7:  # the one chunk is not whole
        with pytest.raises(InputError, match="no whole decision in it"):
            recover(path)
        return
    recovery = recover(path)
    assert recovery.written == str(tmp_path / "cut-recovered.mcap")
    log = open_log(Path(recovery.written))
    assert log.result["outcome"] == "error"
    assert log.result["reason"].startswith("recovered: truncated")
    chains = [one.chain for one in log.decisions()]
    assert chains == before[: len(chains)]
    assert replay(Path(recovery.written)).identical
    assert audit(Path(recovery.written)).violations == ()


def test_recover_on_the_command_line(source, tmp_path, capsys):
    path = damaged(tmp_path, source.read_bytes()[:-100])
    out = tmp_path / "out.mcap"
    assert main(["recover", str(path), "--out", str(out), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["decisions"] == 6
    assert document["damage"].startswith("truncated")
    assert main(["replay", str(out)]) == 0
    assert main(["recover", str(tmp_path / "none.mcap")]) == 2
    assert "no such file" in capsys.readouterr().err


def test_a_second_is_all_that_can_be_lost(tmp_path):
    """Whatever is read from the partial file while it is written is at most a second behind."""
    period = 100_000_000
    log = LogWriter(tmp_path / "a.mcap", b"{}", b"{}", "<mujoco/>")
    for k in range(35):
        log.write("/decision", pb.Decision(sequence=k), k * period)
        found = [
            one.time_ns for one in itertools.takewhile(lambda _: True, sound(log.partial_path))
        ]
        assert k * period - max(found, default=0) <= FLUSH_PERIOD_NS
    log.close()


def sound(path):
    try:
        for item in walk(path):
            if isinstance(item, Packet):
                yield item
    except InputError:
        return


def test_a_full_disk_ends_in_a_line_and_a_readable_log(recorded, tmp_path):
    """A limit on the file's size stands for the disk: a write fails in the middle of a chunk."""
    recorded("empty", "drone", 1)  # compiles everything, which writes files of its own
    path = tmp_path / "a.mcap"

    def work(tell):
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (250_000, 250_000))
        with contextlib.redirect_stderr(io.StringIO()) as said:
            code = main(["run", "empty", "--robot", "drone", "--seed", "1", "--log", str(path)])
        tell(f"{code} {said.getvalue()}")

    ended = in_child(work, 60.0)
    line = ended.lines[-1] if ended.lines[-1] else ended.lines[-2]
    assert line.startswith(f"2 wayproof: log '{path}': ")
    assert line.endswith("File too large; what fitted is in .partial")
    recovery = recover(tmp_path / "a.mcap.partial")
    assert recovery.decisions >= 10
    assert replay(Path(recovery.written)).identical


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
        (MAGIC + HEAD.pack(1, 2**62), "a record of 4611686018427387904 bytes at byte 8"),
        (MAGIC + HEAD.pack(1, 1000) + bytes(10), "10 of 1000 bytes of the record at byte 8"),
        (bare_chunk(bytes(100), 2**40), "unpacks to 1099511627776 bytes"),
        (bare_chunk(bytes(2**20), 1000), "unpacks to 1048576 bytes, expected 1000"),
        (bare_chunk(bytes(2**22), 2**22), "over 4096 times the file's size"),
        (bare_chunk(b"", 0, "lz4"), "compression 'lz4', expected 'zstd' or none"),
        (MAGIC + HEAD.pack(12, 4) + b"\xff\xff\xff\xff", "4294967295 bytes in a record with 0"),
        (MAGIC + HEAD.pack(5, 22) + bytes(22), "channel 0, which was never declared"),
    ],
)
def test_sizes_are_checked_before_anything_of_that_size_is_made(tmp_path, data, said):
    path = damaged(tmp_path, data)
    with pytest.raises(InputError, match=said.replace("(", r"\(")):
        list(walk(path))
    assert GREATEST_RECORD == 64 * 2**20


def write_items(items, target):
    """A log of these items, whose checksums hold."""
    with target.open("wb") as file:
        writer = Writer(file, use_chunking=False)
        writer.start(profile="wayproof")
        channels = {}
        for item in items:
            if isinstance(item, Metadata):
                writer.add_metadata(item.name, item.fields)
            elif isinstance(item, Attachment):
                writer.add_attachment(0, 0, item.name, "", item.data)
            else:
                if item.topic not in channels:
                    schema = writer.register_schema(item.schema, "protobuf", b"")
                    channels[item.topic] = writer.register_channel(item.topic, "protobuf", schema)
                writer.add_message(channels[item.topic], item.time_ns, item.data, item.time_ns)
        writer.finish()
    return target


def rewritten(source, target, change):
    """A log with valid checksums and digests whose config was changed."""
    items = list(walk(source))
    config = json.loads(next(one.data for one in items if one[0] == "config.json"))
    change(config)
    data = json.dumps(config).encode()
    digest = {digest_name("config.json"): hashlib.sha256(data).hexdigest()}
    for at, item in enumerate(items):
        if isinstance(item, Metadata):
            items[at] = item._replace(fields={**item.fields, **digest})
        elif isinstance(item, Attachment) and item.name == "config.json":
            items[at] = item._replace(data=data)
    return write_items(items, target)


def test_code_named_in_a_log_is_not_imported(source, tmp_path, capsys, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    evil = tmp_path / "evil.py"
    evil.write_text(f"open({str(tmp_path / 'touched')!r}, 'w')\nclass Planner: ...\n")

    def name_it(config):
        config["planner"]["name"] = "evil:Planner"

    path = rewritten(source, tmp_path / "evil.mcap", name_it)
    for verb in (["replay"], ["replay", "--closed-loop"], ["audit"], ["recover"]):
        assert main([*verb, str(path)]) == 2
        assert "expected --allow-plugins" in capsys.readouterr().err
    assert not (tmp_path / "touched").exists()


def test_a_name_that_no_registry_has_is_one_line(source, tmp_path, capsys):
    def misspell(config):
        config["map"]["kind"] = "vyxel"

    path = rewritten(source, tmp_path / "misspelt.mcap", misspell)
    assert main(["replay", str(path)]) == 2
    assert "unknown map.kind 'vyxel'; did you mean 'voxel'?" in capsys.readouterr().err


def test_a_time_that_is_none_is_refused_before_it_is_reckoned_with():
    pose, decision = pb.Pose(), pb.Decision()
    pose.timestamp.nanos = -1
    decision.trajectory.start.seconds = 1 << 60
    for one in (pose, decision):
        schema, data = one.DESCRIPTOR.full_name, one.SerializeToString()
        with pytest.raises(InputError, match="cannot be decoded"):
            decode(Packet(schema, "/forged", 0, data), Path("forged.mcap"))


@pytest.mark.parametrize("x", [1e214, float("inf"), float("nan")])
def test_a_true_place_where_no_robot_is_is_refused(x):
    schema, data = "wayproof.Truth", pb.Truth(position=[x, 0.0, 1.0]).SerializeToString()
    with pytest.raises(InputError, match="cannot be decoded"):
        decode(Packet(schema, "/truth", 0, data), Path("forged.mcap"))


@pytest.mark.parametrize(
    "message",
    [
        pb.Decision(reason="at rest\x1b[31m"),
        pb.Decision(label="none\nsuccess"),
        pb.Streams(streams=[pb.StreamHash(name="pose\x9b2J")]),
        pb.Perturbation(streams=["pose", "\x07"]),
    ],
)
def test_a_text_that_a_terminal_takes_for_a_command_is_refused(message):
    schema, data = message.DESCRIPTOR.full_name, message.SerializeToString()
    with pytest.raises(InputError, match="cannot be decoded"):
        decode(Packet(schema, "/forged", 0, data), Path("forged.mcap"))


def test_an_error_is_one_printable_line(tmp_path, capsys):
    for name in ("a\x1b[31mb", "a\nb", "a\u2028b", "a\x85b"):
        assert main(["replay", str(tmp_path / name)]) == 2
        told = capsys.readouterr().err
        assert told.endswith("no such file\n")
        assert told[:-1].isprintable()


def test_a_text_that_looks_like_markup_is_printed_as_it_stands(source, tmp_path, capsys):
    items = list(walk(source))
    for at, item in enumerate(items):
        if isinstance(item, Packet) and item.schema == pb.Decision.DESCRIPTOR.full_name:
            decision = pb.Decision.FromString(item.data)
            decision.reason = "[/x] :warning: $\\frac{$"
            items[at] = item._replace(data=decision.SerializeToString())
    path = write_items(items, tmp_path / "markup.mcap")
    drawn = ["--png", str(tmp_path / "moment.png")]
    assert main(["explain", str(path), "1", *drawn]) == 2  # the chain is not that of the reasons
    assert main(["explain", str(path), "1", *drawn, "--unchecked"]) == 0
    assert "[/x] :warning: $\\frac{$" in capsys.readouterr().out


FLOODS = {
    "/truth": (pb.Truth, "2 messages of '/truth' for decision "),
    "/pose": (pb.Pose, "2 messages of '/pose' for decision "),
    "/sensor/lidar": (pb.Sweep, "257 messages of '/sensor/lidar' for decision "),
    "/sensor/lidar/info": (pb.SensorInfo, "1001 sensors' tables, expected at most 1000"),
    "/perturbation": (pb.Perturbation, "messages, expected at most 2"),
}


@pytest.mark.parametrize("topic", FLOODS)
def test_messages_are_counted_before_they_are_made(tmp_path, topic):
    """Chunks of empty messages compress by thousands: a small file could fill the memory."""
    kind, said = FLOODS[topic]
    path = with_chunks([flood(kind, topic, 30_000)], tmp_path / "flood.mcap")
    with pytest.raises(InputError, match=re.escape(said)):
        list(walk(path))


def flood(kind, topic, count):
    return chunk(declared(NUMBER, kind.DESCRIPTOR.full_name, topic) + message(NUMBER, b"") * count)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (record(0x7F, b"") * 10_001, "10001 records in chunks that are no messages"),
        (declared(1, "a", "b") * 5001, "10001 records in chunks that are no messages"),
        (
            declared(1, "wayproof.Decision", "/decision") + message(1, bytes(5 * 2**20)),
            "bytes of messages other than sweeps, expected at most",
        ),
    ],
)
def test_other_records_and_their_bytes_are_counted_too(tmp_path, data, said):
    path = with_chunks([chunk(data)], tmp_path / "flood.mcap")
    with pytest.raises(InputError, match=re.escape(said)):
        list(walk(path))


def test_a_large_file_may_hold_so_many_and_no_more(monkeypatch):
    monkeypatch.setattr(container, "MOST_MESSAGES", 30)
    monkeypatch.setattr(container, "MOST_DECISIONS", 10)
    census = container._Census(2**40)
    for _ in range(10):
        census.count("wayproof.Decision", "/decision", 100)
    with pytest.raises(container._Broken, match="11 decisions, expected at most 10"):
        census.count("wayproof.Decision", "/decision", 100)
    for _ in range(19):
        census.count("wayproof.Perturbation", "/perturbation", 100)
    with pytest.raises(container._Broken, match="31 messages, expected at most 30"):
        census.count("wayproof.Perturbation", "/perturbation", 100)
