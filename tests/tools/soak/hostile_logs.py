"""Hostile logs with valid checksums: scenes, floods of messages, decompression bombs."""

from __future__ import annotations

import re
import shutil
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import zstandard
from google.protobuf.message import Message

from tests.harness.replay.forgeries import Forgery
from tests.tools.small_log import COMMITTED
from tests.tools.soak.hostile_files import Maker
from wayproof.harness.config import Config
from wayproof.harness.log.codec.container import HEAD, MAGIC
from wayproof.harness.log.machine import CODE
from wayproof.harness.log.reader import open_log
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.study.contents import PROGRAM
from wayproof.harness.study.file import read_study
from wayproof.harness.study.matching import mismatch
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.store import Store

LOGS: dict[str, Maker] = {}
"""Name of a hostile log -> function that makes it."""

STUDY = """
name = "hostile"
worlds = ["{config.world}"]
robots = ["{config.robot}"]
seeds = [{config.seed}]
[set]
"episode.time_limit" = {config.episode.time_limit}
"""

CHUNK_BYTES = 60 * 2**20
CHUNKS = 20
END, CHUNK, MESSAGE, SCHEMA, CHANNEL, UNKNOWN = 15, 6, 5, 3, 4, 0x7F


def with_scene(edit: Callable[[str], str], target: Path) -> Path:
    """Write the small log with another scene and recomputed hashes."""
    forgery = Forgery(COMMITTED)
    forgery.scene = edit(forgery.scene)
    return forgery.write(target)


def _into_head(text: str) -> Callable[[str], str]:
    return lambda scene: re.sub(r"<mujoco([^>]*)>", rf"<mujoco\1>{text}", scene, count=1)


def _into_world(text: str) -> Callable[[str], str]:
    return lambda scene: scene.replace("</worldbody>", text + "</worldbody>", 1)


SCENES = {
    "nuser_body 3e8": _into_head('<size nuser_body="300000000"/>'),
    "20,000 bodies in one another": _into_world("<body>" * 20_000 + "</body>" * 20_000),
    "ccd_iterations 2e9": _into_head('<option ccd_iterations="2000000000" ccd_tolerance="0"/>'),
    "noslip_iterations 2e9": _into_head('<option noslip_iterations="2000000000"/>'),
    "a mesh in a file": _into_head('<asset><mesh name="m" file="/etc/passwd"/></asset>'),
    "a document type": lambda scene: '<!DOCTYPE x [<!ENTITY a "aaaa">]>' + scene,
    "400 textures of 2048 x 2048": _into_head(
        "<asset>"
        + "".join(
            f'<texture name="t{k}" type="2d" builtin="flat" width="2048" height="2048"/>'
            for k in range(400)
        )
        + "</asset>"
    ),
    "3,000 spheres in one place": _into_world(
        "".join(
            f'<body pos="5 5 {1 + 0.001 * k}"><freejoint/><geom size=".4" mass="1"/></body>'
            for k in range(3000)
        )
    ),
}

VERBS = {"explain": ["explain"], "replay simulate": ["replay", "simulate"]}


def _scene(name: str, verb: str) -> None:
    def make(folder: Path) -> list[str]:
        path = with_scene(SCENES[name], folder / "hostile.mcap")
        first, *more = VERBS[verb]
        return [first, str(path), *more]

    LOGS[f"log: scene with {name}; {verb}"] = make


for scene in SCENES:
    for verb in VERBS:
        _scene(scene, verb)


def study_with_log(folder: Path, log: Path) -> Path:
    """Return a study's folder of one episode, whose log is given."""
    opened = open_log(log)
    config: Config = opened.config
    written = folder / "study.toml"
    written.write_text(STUDY.format(config=config))
    study = read_study(str(written))
    store = Store(folder / "study")
    contents = {PROGRAM: opened.run[CODE]}
    [planned] = plan_episodes(study, contents)
    assert (unlike := mismatch(open_log(COMMITTED), planned)) == "", unlike  # or nothing reads it
    with store.open():
        shutil.copyfile(log, store.log(planned.key))
        store.keep_study(study, contents)
    return store.folder


def _report(name: str) -> None:
    def make(folder: Path) -> list[str]:
        path = with_scene(SCENES[name], folder / "hostile.mcap")
        return ["report", str(study_with_log(folder, path))]

    LOGS[f"log: scene with {name}; report"] = make


for name in ("nuser_body 3e8", "20,000 bodies in one another", "a mesh in a file"):
    _report(name)


def record(opcode: int, body: bytes) -> bytes:
    """Return one record of the container."""
    return HEAD.pack(opcode, len(body)) + body


def chunk(data: bytes) -> bytes:
    """Return a chunk of records, packed."""
    packed = zstandard.ZstdCompressor(level=3).compress(data)
    head = struct.pack("<QQQI", 10**9, 10**9, len(data), zlib.crc32(data))
    body = head + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(packed)) + packed
    return record(CHUNK, body)


def with_chunks(chunks: list[bytes], target: Path) -> Path:
    """Return the short log with more chunks before its end of data."""
    data = COMMITTED.read_bytes()
    place = len(MAGIC)
    while data[place] != END:
        place += HEAD.size + HEAD.unpack_from(data, place)[1]
    end = record(END, bytes(4)) + record(2, bytes(20)) + MAGIC
    target.write_bytes(data[:place] + b"".join(chunks) + end)
    return target


def message(channel: int, data: bytes) -> bytes:
    """Return a message one second after the start."""
    return record(MESSAGE, struct.pack("<HIQQ", channel, 0, 10**9, 10**9) + data)


def declared(channel: int, schema: str, topic: str) -> bytes:
    """Return a schema and a channel of it, of one number."""

    def text(value: str) -> bytes:
        return struct.pack("<I", len(value)) + value.encode()

    first = struct.pack("<H", channel) + text(schema) + text("protobuf") + bytes(4)
    second = struct.pack("<HH", channel, channel) + text(topic) + text("protobuf") + bytes(4)
    return record(SCHEMA, first) + record(CHANNEL, second)


def flood(one: bytes, count: int, chunks: int, head: bytes, target: Path) -> Path:
    """Return the short log and after it the same record over and over."""
    return with_chunks([chunk(head + one * count)] * chunks, target)


FLOODS: dict[str, tuple[str, type[Message]]] = {
    "/truth": ("explain", pb.Truth),
    "/pose": ("replay", pb.Pose),
    "/perturbation": ("explain", pb.Perturbation),
}

NUMBER = 999


def _flood(topic: str, verb: str, kind: type[Message]) -> None:
    def make(folder: Path) -> list[str]:
        one = message(NUMBER, pb.Truth(sequence=1).SerializeToString() if kind is pb.Truth else b"")
        head = declared(NUMBER, kind.DESCRIPTOR.full_name, topic)
        count = CHUNK_BYTES // len(one)
        return [verb, str(flood(one, count, CHUNKS, head, target=folder / "hostile.mcap"))]

    LOGS[f"log: {CHUNKS} chunks of empty {topic}; {verb}"] = make


for topic, (verb_of_flood, kind) in FLOODS.items():
    _flood(topic, verb_of_flood, kind)


def _add(name: str, make_log: Callable[[Path], Path], *arguments: str) -> None:
    def make(folder: Path) -> list[str]:
        return [arguments[0], str(make_log(folder / "hostile.mcap")), *arguments[1:]]

    LOGS[f"log: {name}; {' '.join(arguments)}"] = make


def _a_million(target: Path) -> Path:
    head = declared(NUMBER, "wayproof.Perturbation", "/perturbation")
    return flood(message(NUMBER, b""), count=999_000, chunks=1, head=head, target=target)


def _unknown_records(target: Path) -> Path:
    return flood(
        record(UNKNOWN, b""), count=CHUNK_BYTES // HEAD.size, chunks=CHUNKS, head=b"", target=target
    )


def _channels(target: Path) -> Path:
    one = declared(NUMBER, "a", "b")
    return flood(one, count=CHUNK_BYTES // len(one), chunks=CHUNKS, head=b"", target=target)


def _points(target: Path) -> Path:
    """Return one decision whose path has as many points as fit, none with a field set."""
    field = pb.Decision.DESCRIPTOR.fields_by_name["trajectory"].number
    inner = pb.Trajectory.DESCRIPTOR.fields_by_name["path"].number
    path = bytes([inner << 3 | 2, 0]) * (CHUNK_BYTES // 2)
    data = _varint(field << 3 | 2) + _varint(len(path)) + path
    head = declared(NUMBER, "wayproof.Decision", "/decision")
    return with_chunks([chunk(head + message(NUMBER, data))], target)


def _varint(number: int) -> bytes:
    digits = bytearray()
    while number > 127:
        digits.append(number & 127 | 128)
        number >>= 7
    return bytes([*digits, number])


def _says_little(target: Path) -> Path:
    packed = zstandard.ZstdCompressor(level=3).compress(bytes(2**30))
    head = struct.pack("<QQQI", 0, 0, 1000, 0) + struct.pack("<I", 4) + b"zstd"
    body = head + struct.pack("<Q", len(packed)) + packed
    return with_chunks([record(CHUNK, body)], target)


_add("a million empty /perturbation", _a_million, "explain")
_add(f"{CHUNKS} chunks of records of no kind", _unknown_records, "explain")
_add(f"{CHUNKS} chunks of channels", _channels, "explain")
_add("a decision of 30 million points", _points, "explain")
_add("a chunk of 1 GiB that says 1000 bytes", _says_little, "explain")
