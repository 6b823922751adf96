"""Copies of a log: thinned to its decisions, or of the readable part."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from google.protobuf.message import Message

from wayproof.harness.log.codec.container import walk
from wayproof.harness.log.codec.messages import read_messages, time_of, topic_of
from wayproof.harness.log.head import ATTACHMENTS, Head, read_head
from wayproof.harness.log.reader import LONGEST_NS, open_log
from wayproof.harness.log.writer import PREDICTOR_STDERR, STDERR, TRACEBACK, LogWriter
from wayproof.harness.schema import wayproof_pb2 as pb

GLOBAL_PATH_PERIOD_NS = 1_000_000_000
"""Simulated time between the kept global paths that a log of decisions holds, ns."""


def thin(path: Path, target: Path | None = None) -> None:
    """Remove from a finished log what its seed reproduces: sweeps, states and most global paths.

    Args:
        path: The log.
        target: Name of the thinned log; by default it replaces the log.

    Raises:
        InputError: It is no finished log, or the folder cannot be written to.
    """
    result = open_log(path, allow_plugins=True).result
    head = read_head(walk(path, head_only=True), path, allow_plugins=True)
    write_copy(
        target or path,
        head,
        _with_few_global_paths(read_messages(path)),
        result,
        record="decisions",
    )


def _with_few_global_paths(messages: Iterable[Message]) -> Iterator[Message]:
    """Yield messages; of the global paths only new ones, and one per second."""
    written_ns = -GLOBAL_PATH_PERIOD_NS
    for message in messages:
        if isinstance(message, pb.Decision):
            now_ns = time_of(message)
            if message.planner or now_ns - written_ns >= GLOBAL_PATH_PERIOD_NS:
                written_ns = now_ns
            else:
                message.ClearField("global_path")
        yield message


def write_copy(
    path: Path,
    head: Head,
    messages: Iterable[Message],
    result: Mapping[str, str],
    record: str = "full",
) -> None:
    """Write a log with the head of another one.

    Args:
        path: Final name; a log of that name is replaced when the copy is complete.
        head: Head of the other log, copied unchanged.
        messages: Messages in file order; beam tables come from the head.
        result: Outcome and figures.
        record: `full`, or `decisions` to leave out what the seed reproduces.
    """
    config, mission, _ = (head.attachments[name] for name in ATTACHMENTS)
    # The source still exists, so no flush is needed, and larger chunks compress better.
    packed = record == "decisions"
    with LogWriter(path, config, mission, head.scene, head.run, LONGEST_NS, packed) as log:
        log.record = record
        for name, fields in head.metadata.items():
            if name not in ("run", "result"):
                log.note(name, fields)
        for topic, info in head.tables:
            log.write(topic, info, 0)
        for message in messages:
            if not isinstance(message, pb.SensorInfo):
                log.write(topic_of(message), message, time_of(message))
        for name in (TRACEBACK, STDERR, PREDICTOR_STDERR):
            if name in head.attachments:
                log.attach(name, head.attachments[name].decode(errors="replace"))
        log.finish(result)
