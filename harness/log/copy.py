"""Writing a log from another one: without what its seed gives again, or what of it is readable."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from google.protobuf.message import Message

from wayproof.harness.log.codec.container import walk
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import ATTACHMENTS, LONGEST_NS, Head, open_log, read_head
from wayproof.harness.log.writer import TRACEBACK, LogWriter
from wayproof.harness.schema import wayproof_pb2 as pb

GUIDE_PERIOD_NS = 1_000_000_000
"""Simulated time for which a log of decisions leaves out global paths that were kept."""

TOPICS: dict[type[Message], str] = {
    pb.Pose: "/pose",
    pb.Latency: "/latency",
    pb.StackCommand: "/command",
    pb.State: "/state",
    pb.Decision: "/decision",
    pb.Truth: "/truth",
    pb.Streams: "/streams",
    pb.Perturbation: "/perturbation",
}
"""Where each sort of message stands in a log, those of sensors apart."""


def thin(path: Path, target: Path | None = None) -> None:
    """Leave out of a finished log what its seed gives again: sweeps, states and most global paths.

    Args:
        path: The log.
        target: Name of the new one; by default it takes the log's place.

    Raises:
        InputError: It is no finished log, or the folder cannot be written to.
    """
    result = open_log(path, allow_plugins=True).result
    head = read_head(walk(path, head_only=True), path, allow_plugins=True)
    write_copy(
        target or path, head, _with_few_guides(read_messages(path)), result, record="decisions"
    )


def _with_few_guides(messages: Iterable[Message]) -> Iterator[Message]:
    """Messages with a decision's global path where it was searched for, and once a second."""
    told_ns = -GUIDE_PERIOD_NS
    for message in messages:
        if isinstance(message, pb.Decision):
            now_ns = time_of(message)
            if message.planner or now_ns - told_ns >= GUIDE_PERIOD_NS:
                told_ns = now_ns
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
        path: Its final name; the log there is replaced when all is written.
        head: What comes first, as it was.
        messages: In file order; sensors' tables are those of the head.
        result: Outcome and figures.
        record: `full`, or `decisions` to leave out what the seed gives again.
    """
    config, mission, _ = (head.attachments[name] for name in ATTACHMENTS)
    # What it is written from is still there, so nothing hangs on flushing, and larger chunks pack
    # better.
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
        if TRACEBACK in head.attachments:
            log.attach(TRACEBACK, head.attachments[TRACEBACK].decode(errors="replace"))
        log.finish(result)


def topic_of(message: Message) -> str:
    """Where a message stands in a log."""
    if isinstance(message, pb.SensorInfo):
        return f"/sensor/{message.name}/info"
    if isinstance(message, pb.Sweep):
        return f"/sensor/{message.sensor}"
    return TOPICS[type(message)]


def time_of(message: Message) -> int:
    """Simulated time of a message, ns; sensors stand before everything."""
    if isinstance(message, pb.SensorInfo):
        return 0
    time_ns: int = message.timestamp.ToNanoseconds()  # type: ignore[attr-defined]
    return time_ns
