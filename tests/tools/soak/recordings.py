"""Broken recordings: each must be read, its faults counted, or be refused in one line.

Run by `python -m tests.tools.soak recordings --count 2000`.
"""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from tests.tools.soak.cases import watched
from tests.tools.soak.child import scratch
from tests.tools.soak.fuzz import mutate
from tests.tools.soak.recording_sources import SOURCES
from wayproof.harness.bench.table import Progress
from wayproof.harness.recordings.bags.container import RawMessage, container_of, messages_of
from wayproof.harness.recordings.bags.messages import typestore
from wayproof.harness.recordings.formats import open_recording

SIZES = (0, 1, 0xFF, 0xFFFF, 2**24, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63 - 1, 2**64 - 1)
"""Hostile values of a length or a count."""

TYPES = (b"LaserScan", b"PointCloud2", b"Image", b"CameraInfo", b"Odometry", b"TFMessage")

Rng = np.random.Generator


def cut(data: bytes, rng: Rng) -> bytes:
    """Cut off the end."""
    return data[: int(rng.integers(len(data)))]


def reordered(data: bytes, rng: Rng) -> bytes:
    """Exchange two stretches of bytes, of lines if it is a text."""
    if b"\0" not in data[:1000] and data.count(b"\n") > 3:
        rows = data.splitlines(keepends=True)
        first, second = (int(k) for k in rng.integers(len(rows), size=2))
        rows[first], rows[second] = rows[second], rows[first]
        return b"".join(rows)
    length = int(rng.integers(1, max(len(data) // 4, 2)))
    places = sorted(int(k) for k in rng.integers(max(len(data) - length, 1), size=2))
    first, second = places[0], max(places[1], places[0] + length)
    return b"".join(
        (
            data[:first],
            data[second : second + length],
            data[first + length : second],
            data[first : first + length],
            data[second + length :],
        )
    )


def wrong_types(data: bytes, rng: Rng) -> bytes:
    """Exchange the names of types, or turn a number of a text into a word."""
    there = [name for name in TYPES if name in data]
    if there:
        one = there[int(rng.integers(len(there)))]
        others = [name for name in TYPES if name != one]
        other = others[int(rng.integers(len(others)))]
        return data.replace(one, other.ljust(len(one), b"_")[: len(one)])
    place = int(rng.integers(len(data)))
    words = (
        b" nan ",
        b" inf ",
        b" -1 ",
        b" 1e400 ",
        b" word ",
        b" 1_0 ",
        b"\xff\xfe",
        b" 99999999 ",
    )
    word = words[int(rng.integers(len(words)))]
    return data[:place] + word + data[place + len(word) :]


def hostile_sizes(data: bytes, rng: Rng) -> bytes:
    """Write hostile lengths at some places."""
    changed = bytearray(data)
    for _ in range(int(rng.integers(1, 6))):
        size = SIZES[int(rng.integers(len(SIZES)))]
        width = 4 if rng.integers(2) else 8
        place = int(rng.integers(max(len(data) - width, 1)))
        changed[place : place + width] = (size % 2 ** (8 * width)).to_bytes(width, "little")
    return bytes(changed)


BYTES: dict[str, Callable[[bytes, Rng], bytes]] = {
    "cut": cut,
    "flipped": mutate,
    "reordered": reordered,
    "types": wrong_types,
    "sizes": hostile_sizes,
}
"""Ways of breaking the bytes of a file."""

MESSAGES = "messages"
"""The way of breaking the messages of a bag, in a container that is sound."""

KINDS = (*BYTES, MESSAGES)


def soak_recordings(count: int, seed: int, progress: Progress, first: int = 0) -> SimpleNamespace:
    """Break small recordings of every format `count` times, in every way in turn."""
    kinds = [f"{kind} of {name}" for kind in KINDS for name in SOURCES]
    with tempfile.TemporaryDirectory(dir=scratch()) as name:
        folder = Path(name)
        for key in SOURCES:
            (folder / key).mkdir()
        sound = {key: make(folder / key) for key, make in SOURCES.items()}
        for path in sound.values():
            read_whole(path)  # compiles everything; each is sound

        def case(kind: str, rng: Rng) -> None:
            warnings.simplefilter("error")  # a warning would be a second line
            way, _, source = kind.partition(" of ")
            with tempfile.TemporaryDirectory(dir=folder) as inner:
                read_whole(break_one(sound[source], way, Path(inner), rng))

        return watched(case, kinds, folder, range(first, first + count), seed, progress)


def break_one(sound: Path, kind: str, folder: Path, rng: Rng) -> Path:
    """Write a broken copy of a recording into a folder; return its path."""
    copy = folder / sound.name
    if sound.is_dir():
        shutil.copytree(sound, copy)
        files = sorted(one for one in copy.rglob("*") if one.is_file())
        file = files[int(rng.integers(len(files)))]
    else:
        shutil.copy(sound, copy)
        file = copy
    if kind == MESSAGES and container_of(file) is not None and "episode" not in file.name:
        _break_messages(file, rng)
    else:
        way = BYTES.get(kind, mutate)
        file.write_bytes(way(file.read_bytes(), rng))
    return copy


def _break_messages(file: Path, rng: Rng) -> None:
    """Break some messages of a bag, and write them into a sound container again."""
    raws = [raw._replace(data=bytes(raw.data)) for raw in messages_of([file], Counter())]
    ways = [mutate, hostile_sizes, cut, hostile_sizes]
    for _ in range(int(rng.integers(1, len(raws)))):
        place = int(rng.integers(len(raws)))
        way = ways[int(rng.integers(len(ways)))]
        raws[place] = raws[place]._replace(data=way(bytes(raws[place].data) or b"\0", rng))
    if rng.integers(3) == 0:
        rng.shuffle(raws)
    if rng.integers(3) == 0:  # a topic of another type
        first, second = (raws[int(k)] for k in rng.integers(len(raws), size=2))
        turned = [raw._replace(type=second.type) for raw in raws if raw.topic == first.topic]
        raws = [raw for raw in raws if raw.topic != first.topic] + turned
    file.unlink()
    _write_raw(file, raws)


def _write_raw(file: Path, raws: list[RawMessage]) -> None:
    """Write messages as they are."""
    from rosbags import rosbag1, rosbag2

    with tempfile.TemporaryDirectory(dir=file.parent) as folder:
        out = Path(folder) / "bag"
        writer: Any
        if file.suffix == ".bag":
            writer = rosbag1.Writer(out)
        else:
            plugins = {".mcap": rosbag2.StoragePlugin.MCAP, ".db3": rosbag2.StoragePlugin.SQLITE3}
            writer = rosbag2.Writer(out, version=8, storage_plugin=plugins[file.suffix])
        writer.open()
        topics: dict[str, Any] = {}
        for raw in raws:
            if raw.topic not in topics:
                store = typestore(raw.encoding)
                topics[raw.topic] = writer.add_connection(raw.topic, raw.type, typestore=store)
            writer.write(topics[raw.topic], raw.logged_ns, raw.data)
        writer.close()
        written = out if file.suffix == ".bag" else next(out.glob(f"*{file.suffix}"))
        written.replace(file)
    if file.suffix == ".db3":
        with closing(sqlite3.connect(file)) as base:
            base.execute("VACUUM")


def read_whole(path: Path) -> None:
    """Open a recording and read all of it."""
    recording = open_recording(path)
    for sweep in recording.sweeps():
        if np.isnan(sweep.ranges).any() or not (sweep.ranges > 0.0).all():
            raise AssertionError("a range that is none")
        if len(sweep.directions) != len(sweep.ranges):
            raise AssertionError("ranges without a direction")
    assert recording.faults is not None
