"""Fuzzing of logs, settings and scenes: each must be refused in a line, or read."""

from __future__ import annotations

import contextlib
import hashlib
import re
import tempfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from mcap.writer import CompressionType, Writer

from tests.tools.small_log import COMMITTED
from tests.tools.soak.cases import watched
from tests.tools.soak.child import scratch
from wayproof.harness.bench.table import Progress
from wayproof.harness.config_document import from_json, to_json
from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.container import Attachment, Metadata, walk
from wayproof.harness.log.digest import CONTENT, RESULT, ContentDigest
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.log.recover import recover
from wayproof.harness.log.writer import digest_name
from wayproof.harness.recompute.rebuild import rebuild
from wayproof.harness.replay.replay import replay
from wayproof.harness.stack.build import build_navigator

KINDS = ("bytes", "forged", "settings", "scene")


def soak_fuzz(count: int, seed: int, progress: Progress, first: int = 0) -> SimpleNamespace:
    """Mutate a small log `count` times: its bytes, content, settings and scene in turn."""
    with tempfile.TemporaryDirectory(dir=scratch()) as name:
        folder = Path(name)
        source = folder / "source.mcap"
        source.write_bytes(COMMITTED.read_bytes())
        replay(source)
        log = open_log(source)

        def case(kind: str, rng: np.random.Generator) -> None:
            run_case(kind, source, log, rng)

        return watched(case, KINDS, folder, range(first, first + count), seed, progress)


def run_case(kind: str, source: Path, log: Log, rng: np.random.Generator) -> None:
    """Mutate and read once."""
    if kind == "settings":
        config = from_json(mutate_values(to_json(log.config).decode(), rng).encode())
        build_navigator(config, log.mission, log.beams)
        return
    if kind == "scene":
        rebuild(replace(log, scene=mutate_values(log.scene, rng)))
        return
    with tempfile.TemporaryDirectory(dir=source.parent) as name:
        path = Path(name) / "mutated.mcap"
        path.write_bytes(mutate(source.read_bytes(), rng) if kind == "bytes" else b"")
        if kind == "forged":
            forge(source, path, rng)
        else:
            with contextlib.suppress(InputError):  # it may be whole
                recover(path, path.with_name("recovered.mcap"))
        replay(path)


DIGITS = b"0123456789"
NASTY = (b"0", b"-1", b"1e308", b"1e-308", b"999999999999", b'""', b"null", b"[]", b"{}", b"true")

NUMBER = re.compile(r"(?<![\w.])(-?\d+(?:\.\d+)?(?:e[-+]?\d+)?)(?![\w.])")
STRING = re.compile(r'"([^"\\]*)"')
NUMBERS = (
    "0", "-1", "1", "2", "3", "64", "1000", "65536", "999999999999", "1e308", "1e-308", "1e9",
    "-1e9", "0.5", "-0.5", "1e-3", "4294967296", "-9223372036854775808",
)  # fmt: skip


def mutate(data: bytes, rng: np.random.Generator) -> bytes:
    """Mutate bytes in a few places: flip, replace, cut, double, or change a number."""
    changed = bytearray(data)
    for _ in range(min(int(rng.geometric(0.7)), 8)):
        if not changed:
            return bytes(changed)
        place = int(rng.integers(len(changed)))
        reach = int(rng.integers(1, 65))
        match int(rng.integers(9)):
            case 0:
                changed[place] ^= 1 << int(rng.integers(8))
            case 1:
                changed[place] = int(rng.integers(256))
            case 2:
                del changed[place : place + reach]
            case 3:
                changed[place:place] = changed[place : place + reach]
            case 4:
                changed[place : place + reach] = rng.bytes(reach)
            case 5 if rng.integers(4) == 0:
                del changed[place:]
            case _:
                _change_number(changed, place, rng)
    return bytes(changed)


def mutate_values(text: str, rng: np.random.Generator) -> str:
    """Replace numbers and strings in a text, which stays well-formed; every fourth time `mutate`.

    A parser refuses text that is not well-formed, so that nothing behind it is tested.
    """
    if rng.integers(4) == 0:
        return mutate(text.encode(), rng).decode(errors="replace")
    for _ in range(int(rng.integers(1, 4))):
        pattern = STRING if rng.integers(3) == 0 else NUMBER
        places = [found.span(1) for found in pattern.finditer(text)]
        if not places:
            continue
        begin, end = places[int(rng.integers(len(places)))]
        if pattern is NUMBER:
            value = NUMBERS[int(rng.integers(len(NUMBERS)))]
        else:
            first, last = places[int(rng.integers(len(places)))]
            value = text[first:last]
        text = text[:begin] + value + text[end:]
    return text


def _change_number(changed: bytearray, place: int, rng: np.random.Generator) -> None:
    """Replace the next number in a text by an extreme value."""
    while place < len(changed) and changed[place] not in DIGITS:
        place += 1
    end = place
    while end < len(changed) and changed[end] in DIGITS + b".e":
        end += 1
    changed[place:end] = NASTY[int(rng.integers(len(NASTY)))]


def forge(source: Path, target: Path, rng: np.random.Generator) -> None:
    """Write a log whose content is mutated in one place, with valid checksums."""
    items = list(walk(source))
    chosen = int(rng.integers(len(items)))
    if rng.integers(3) == 0:  # attachments are few, and much follows from them
        chosen = int(rng.choice([i for i, one in enumerate(items) if isinstance(one, Attachment)]))
    attached = {}
    for index, item in enumerate(items):
        if isinstance(item, Attachment):
            attached[item.name] = mutate(item.data, rng) if index == chosen else item.data
    with target.open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD, enable_data_crcs=True)
        writer.start(profile="wayproof")
        channels: dict[str, int] = {}
        digest = ContentDigest()
        for index, item in enumerate(items):
            if isinstance(item, Attachment):
                writer.add_attachment(0, 0, item.name, "", attached[item.name])
                digest.add(Attachment(item.name, attached[item.name]))
            elif isinstance(item, Metadata):
                fields = {
                    name: str(mutate(value.encode(), rng), "latin-1") if index == chosen else value
                    for name, value in item.fields.items()
                }
                if item.name == "run":
                    digests = {n: hashlib.sha256(d).hexdigest() for n, d in attached.items()}
                    fields.update({digest_name(n): d for n, d in digests.items()})
                digest.add(Metadata(item.name, fields))
                if item.name == RESULT:
                    fields[CONTENT] = digest.text()
                writer.add_metadata(item.name, fields)
            else:
                if item.topic not in channels:
                    schema = writer.register_schema(item.schema, "protobuf", b"")
                    channels[item.topic] = writer.register_channel(item.topic, "protobuf", schema)
                data = mutate(item.data, rng) if index == chosen else item.data
                writer.add_message(channels[item.topic], item.time_ns, data, item.time_ns)
                digest.add(item._replace(data=data))
        writer.finish()
