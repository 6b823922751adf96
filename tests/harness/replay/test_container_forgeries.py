"""Logs whose container is forged: written record by record, with every checksum and hash right."""

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path

import pytest
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from tests.models.robots.test_custom import CRAFT, CRAFT_SPEC
from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import (
    MAGIC,
    PROFILE,
    Attachment,
    Item,
    Metadata,
    Packet,
    walk,
)
from wayproof.harness.log.copy import thin
from wayproof.harness.log.digest import CONTENT, RESULT, ContentDigest
from wayproof.harness.log.reader import open_log
from wayproof.harness.recompute.rebuild import made_otherwise
from wayproof.harness.replay.verify import verify
from wayproof.harness.schema import wayproof_pb2 as pb

WORLD = """<mujoco><worldbody><geom type="plane" size="20 20 0.1" name="floor"/>
<geom type="box" pos="1.5 2 1" size="0.2 0.2 1" name="pillar"/></worldbody></mujoco>"""

TRUTH = pb.Truth.DESCRIPTOR.full_name


@pytest.fixture(scope="module")
def source(recorded):
    """A short episode that failed."""
    return Path(recorded("empty", "drone", 1, "episode.time_limit=1.2", "map.resolution=0.2").log)


@dataclass
class Content:
    """What a log is made of, to be edited."""

    items: list[Item]

    @property
    def result(self) -> dict[str, str]:
        """Fields of its result."""
        return next(i.fields for i in self.items if isinstance(i, Metadata) and i.name == RESULT)

    def move(self, change: Callable[[Packet], Packet]) -> None:
        """Change every message."""
        self.items = [change(i) if isinstance(i, Packet) else i for i in self.items]


def write(items: list[Item], path: Path) -> Path:
    """Write a log with the mcap package's writer, with the digest of its content."""
    digest = ContentDigest()
    for item in items:
        digest.add(item)
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=200_000, enable_data_crcs=True)
        writer.start(profile=PROFILE.decode(), library="another")
        schemas: dict[str, int] = {}
        channels: dict[tuple[str, str], int] = {}
        for count, item in enumerate(items):
            if isinstance(item, Metadata):
                new = {CONTENT: digest.text()} if item.name == RESULT else {}
                writer.add_metadata(item.name, {**item.fields, **new})
            elif isinstance(item, Attachment):
                writer.add_attachment(0, 0, item.name, "text/plain", item.data)
            else:
                if item.schema not in schemas:
                    schemas[item.schema] = writer.register_schema(
                        item.schema, "protobuf", item.description
                    )
                channel = channels.get((item.schema, item.topic))
                if channel is None:
                    channel = writer.register_channel(item.topic, "protobuf", schemas[item.schema])
                    channels[item.schema, item.topic] = channel
                writer.add_message(channel, item.time_ns, item.data, item.time_ns, count)
        writer.finish()
    return path


def _in_another_schema(content: Content) -> None:
    """Put a truth of a foreign schema where ours belongs, and ours on another topic."""
    items: list[Item] = []
    for item in content.items:
        if isinstance(item, Packet) and item.schema == TRUTH:
            items += [item._replace(topic="/hidden"), item._replace(schema="foxglove.Truth")]
        else:
            items.append(item)
    content.items = items


def _asked_for_elsewhere(content: Content) -> None:
    asked = next(i.fields for i in content.items if isinstance(i, Metadata) and i.name == "asked")
    asked["goal"] = "[3.0, 1.0]"


def _with_two_results(content: Content) -> None:
    first = {**content.result, "outcome": "success", "reason": "at rest 0.01 m from the goal"}
    content.items.insert(1, Metadata(RESULT, first))


EDITS: dict[str, tuple[Callable[[Content], object], str]] = {
    "a field taken out": (lambda c: c.result.pop("route_length_m"), "result.route_length_m"),
    "the cause taken out": (lambda c: c.result.pop("cause"), "result.cause"),
    "a field added": (lambda c: c.result.update(certified="by an authority"), "result.certified"),
    "two results": (_with_two_results, "metadata 'result'"),
    "a note of another name": (
        lambda c: c.items.insert(1, Metadata("approved", {"by": "me"})),
        "metadata 'approved'",
    ),
    "a file of another name": (
        lambda c: c.items.insert(1, Attachment("../../evil", b"x")),
        "attachment '../../evil'",
    ),
    "truth in another schema": (_in_another_schema, "truth"),
    "the truth described as something else": (
        lambda c: c.move(lambda p: p._replace(description=b"") if p.schema == TRUTH else p),
        "schema of /truth",
    ),
    "all on other topics": (lambda c: c.move(lambda p: p._replace(topic=f"/x{p.topic}")), ""),
    "all at time 0": (lambda c: c.move(lambda p: p._replace(time_ns=0)), "pose"),
    "all at the end of time": (lambda c: c.move(lambda p: p._replace(time_ns=2**63)), ""),
    "time runs back": (
        lambda c: c.move(lambda p: p._replace(time_ns=9 * 10**9 - p.time_ns)),
        "",
    ),
}


def test_a_log_written_by_another_writer_is_verified(source, tmp_path):
    found = verify(write(list(walk(source)), tmp_path / "copy.mcap"), simulate=False)
    assert found.verified, found.findings


@pytest.mark.parametrize("name", EDITS)
def test_a_forged_container_is_not_verified(source, tmp_path, name):
    content = Content(list(walk(source)))
    edit, place = EDITS[name]
    edit(content)
    found = verify(write(content.items, tmp_path / "forged.mcap"), simulate=False)
    assert not found.verified
    assert place in " ".join(one.field for one in found.findings)


def test_settings_that_were_not_asked_for_are_found(source, tmp_path):
    assert made_otherwise(open_log(source)) == []
    content = Content(list(walk(source)))
    _asked_for_elsewhere(content)
    found = made_otherwise(open_log(write(content.items, tmp_path / "forged.mcap")))
    assert "config" in [one.field for one in found]


def test_other_names_of_a_stack_are_claims(recorded):
    log = Path(recorded("empty", "drone", 1, "episode.time_limit=1.2", "stack.name=gap").log)
    assert "answers of a stack named 'gap'" in verify(log, simulate=False).scope.claims


def test_a_recording_that_is_said_to_lack_its_sweeps_is_not_verified(tmp_path, capsys):
    log, small = tmp_path / "shadow.mcap", tmp_path / "small.mcap"
    recording = "examples/recordings/fr079/fr079-200.clf.bz2"
    words = ["shadow", recording, "--robot", "quadruped", "--log", str(log)]
    assert main(words) == 1  # not all of its way was admitted
    thin(log, small)
    capsys.readouterr()
    assert main(["verify", str(small)]) == 1
    assert "sweeps: left out of the log" in capsys.readouterr().out


def _with_index(source: Path, change: Callable[[list[records.McapRecord]], object]) -> bytes:
    """Return a log's bytes with the records of its index changed."""
    data = source.read_bytes()
    stream = BytesIO(data)
    end = 0
    for one in StreamReader(stream, emit_chunks=True).records:
        if isinstance(one, records.DataEnd):
            end = stream.tell()
            break
    index = list(StreamReader(BytesIO(data[end:]), skip_magic=True).records)
    change(index)
    builder = RecordBuilder()
    for one in index:
        if isinstance(one, records.Footer):
            one.summary_crc = one.summary_offset_start = 0
        one.write(builder)
    return data[:end] + builder.end() + MAGIC


def _point_elsewhere(index: list[records.McapRecord]) -> None:
    """List the second chunk twice and the first not at all."""
    chunks = [one for one in index if isinstance(one, records.ChunkIndex)]
    index[index.index(chunks[0])] = chunks[1]


def _hide(index: list[records.McapRecord]) -> None:
    index.remove(next(one for one in index if isinstance(one, records.MetadataIndex)))


def _count_otherwise(index: list[records.McapRecord]) -> None:
    counts = next(one for one in index if isinstance(one, records.Statistics))
    counts.channel_message_counts[1] += 1


def _rename(index: list[records.McapRecord]) -> None:
    next(one for one in index if isinstance(one, records.Channel)).topic = "/elsewhere"


def _misplace_the_messages(index: list[records.McapRecord]) -> None:
    chunk = next(one for one in index if isinstance(one, records.ChunkIndex))
    chunk.message_index_offsets[next(iter(chunk.message_index_offsets))] += 1


def _place_it_in_the_data(index: list[records.McapRecord]) -> None:
    """Name another index: whatever stands in the bytes of an attachment."""
    footer = next(one for one in index if isinstance(one, records.Footer))
    footer.summary_start -= 100


INDEXES = [
    *(_point_elsewhere, _hide, _count_otherwise, _rename),
    *(_misplace_the_messages, _place_it_in_the_data),
]


@pytest.mark.parametrize("change", INDEXES)
def test_an_index_that_lists_something_else_is_damage(source, tmp_path, change):
    many = write(list(walk(source)), tmp_path / "many.mcap")
    same = tmp_path / "same.mcap"
    same.write_bytes(_with_index(many, lambda index: None))
    assert sum(1 for _ in walk(same)) == sum(1 for _ in walk(source))
    forged = tmp_path / "forged.mcap"
    forged.write_bytes(_with_index(many, change))
    with pytest.raises(InputError, match="damaged"):
        list(walk(forged))


def test_a_chunk_behind_the_data_is_damage(source, tmp_path):
    chunk: list[records.McapRecord] = [
        one
        for one in StreamReader(BytesIO(source.read_bytes()), emit_chunks=True).records
        if isinstance(one, records.Chunk)
    ]
    forged = tmp_path / "forged.mcap"
    forged.write_bytes(_with_index(source, lambda index: index.insert(0, chunk[0])))
    with pytest.raises(InputError, match=r"chunk of .* in the index"):
        open_log(forged)


def test_the_world_of_a_robot_from_a_file_is_that_of_the_seed(tmp_path):
    path, short = tmp_path / "craft.mcap", ["--set", "episode.time_limit=0.3"]
    robot = tmp_path / "craft.toml"
    (tmp_path / "craft.xml").write_text(CRAFT)
    robot.write_text(CRAFT_SPEC)
    main(["run", "warehouse", "--robot", str(robot), "--seed", "1", "--log", str(path), *short])
    log = open_log(path)
    assert made_otherwise(log) == []
    shelf = next(one for one in log.scene.splitlines() if '<geom name="shelf' in one)
    cleared = replace(log, scene=log.scene.replace(shelf, "", 1))
    assert made_otherwise(cleared)[0].field == "scene.xml, world warehouse"


def test_the_robot_in_a_world_from_a_file_is_the_registered_one(tmp_path):
    world, path = tmp_path / "world.xml", tmp_path / "w.mcap"
    (tmp_path / "w.xml").write_text(WORLD)
    places = ["--start=0,0", "--goal=3,0"]
    assert main(["import", str(tmp_path / "w.xml"), *places, "--out", str(world)]) == 0
    short = ["--set", "episode.time_limit=0.3", "--log", str(path)]
    main(["run", str(world), "--robot", "drone", "--seed", "1", *short])
    log = open_log(path)
    assert made_otherwise(log) == []
    heavy = replace(log, scene=re.sub('mass="[0-9.]+"', 'mass="9"', log.scene, count=1))
    assert heavy.scene != log.scene
    assert made_otherwise(heavy)[0].field == "scene.xml, robot drone"
