"""Messages of a ROS 2 bag in SQLite (`.db3`)."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from shutil import copyfile
from tempfile import TemporaryDirectory

from wayproof.harness.recordings.bags.container import (
    CUT,
    DAMAGED,
    GREATEST_RECORD,
    MOST_TOPICS,
    RawMessage,
    ros2_type,
    same_path,
)
from wayproof.harness.recordings.recording import Faults

MAGIC = b"SQLite format 3\x00"

TABLES = "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('topics','messages')"
TOPICS = "SELECT id, name, type, serialization_format FROM topics ORDER BY id LIMIT ?"
MESSAGES = "SELECT topic_id, timestamp, data FROM messages ORDER BY rowid"


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


def messages(path: Path, faults: Faults) -> Iterator[RawMessage]:
    """Yield the messages of a bag in the order of their writing; count damaged ones.

    The file is opened for reading alone, and only its tables are, never a view that it defines.
    """
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
