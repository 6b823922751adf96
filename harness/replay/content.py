"""Messages of a log for the checks of consistency, read in one pass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from google.protobuf.message import Message

from wayproof.harness.decision import Difference
from wayproof.harness.errors import InputError
from wayproof.harness.input_messages import inputs_digest, serialized
from wayproof.harness.log.codec.container import Attachment, Item, Metadata, Packet, walk
from wayproof.harness.log.codec.messages import decode, is_ours, time_of, topic_of
from wayproof.harness.log.digest import RESULT, ContentDigest
from wayproof.harness.log.head import ATTACHMENTS
from wayproof.harness.log.reader import CHECK, Log, before, fork_note
from wayproof.harness.log.streams import PRIOR, StreamHashes, own_streams
from wayproof.harness.log.writer import (
    ASKED,
    PACKED_SCENE,
    PLUGINS,
    PREDICTOR_STDERR,
    STDERR,
    TRACEBACK,
    file_descriptor_set,
)
from wayproof.harness.prediction_config import is_outside
from wayproof.harness.schema import wayproof_pb2 as pb

INPUTS = (pb.Sweep, pb.Pose, pb.Goal, pb.Prediction, pb.Latency, pb.StackCommand)
"""Messages that are hashed stream by stream."""


LISTS: dict[type[Message], str] = {
    pb.Decision: "decisions",
    pb.Truth: "truths",
    pb.Streams: "streams",
    pb.Perturbation: "perturbations",
    pb.Pose: "poses",
    pb.Latency: "latencies",
    pb.Goal: "goals",
    pb.RecordedMotion: "motions",
}
"""List of a `Content` by kind of message."""


@dataclass(frozen=True)
class InputRecord:
    """Hashes of the inputs of one decision.

    Attributes:
        digest: Digest of sweeps and pose, computed as `Decision.input_digest`.
        hashes: Running hash of each input stream since the start, by stream.
        sensors: Sensors with a sweep.
    """

    digest: str
    hashes: Mapping[str, str]
    sensors: frozenset[str]


@dataclass(frozen=True)
class Content:
    """Messages of a log, each kind in file order; sweeps only as hashes.

    Attributes:
        decisions: Decisions.
        truths: Ground truth.
        streams: Recorded running hashes.
        perturbations: Records of perturbations.
        poses: Estimated poses.
        latencies: Delays.
        goals: Goals of the decisions of a recording, or of a mission with several.
        motions: Motion of a recording's robot.
        inputs: Hashes of the inputs of each decision; empty if the sweeps were not read.
        strange: Records that no log has, or not there: of another name, topic, type or time, or of
            a name that another one has.
        described: Kinds of messages whose schema in the file is not that of this version: other
            readers take their values for something else.
        digest: Digest of the whole file; empty if it was not computed.
    """

    decisions: list[pb.Decision] = field(default_factory=list)
    truths: list[pb.Truth] = field(default_factory=list)
    streams: list[pb.Streams] = field(default_factory=list)
    perturbations: list[pb.Perturbation] = field(default_factory=list)
    poses: list[pb.Pose] = field(default_factory=list)
    latencies: list[pb.Latency] = field(default_factory=list)
    goals: list[pb.Goal] = field(default_factory=list)
    motions: list[pb.RecordedMotion] = field(default_factory=list)
    inputs: list[InputRecord] = field(default_factory=list)
    strange: list[Difference] = field(default_factory=list)
    described: list[Difference] = field(default_factory=list)
    digest: str = ""

    def add(self, message: Message) -> None:
        """Append a message, unless it is of another kind."""
        if (name := LISTS.get(type(message))) is not None:
            getattr(self, name).append(message)


def read_content(log: Log) -> Content:
    """Read the messages of a log.

    Raises:
        InputError: The file breaks off or is damaged.
    """
    content, digest = Content(), ContentDigest()
    running = None if log.record == "decisions" else _Running(log)
    names, schemas = _Names(log), dict[str, bytes]()
    for item in walk(log.path):
        digest.add(item)
        message = decode(item, log.path) if isinstance(item, Packet) and is_ours(item) else None
        strange = names.fault_of(item) if message is None else _misplaced(item, message, log)
        content.strange.extend([] if strange is None else [strange])
        if message is None:
            continue
        assert isinstance(item, Packet)
        if schemas.get(item.schema) != item.description:
            schemas[item.schema] = item.description
            if item.description != file_descriptor_set(message.DESCRIPTOR):
                one = Difference(f"schema of {item.topic[:80]}", "another", "that of this version")
                content.described.append(one)
        content.add(message)
        if running is None:
            continue
        running.add(message)
        if isinstance(message, pb.Decision):
            content.inputs.append(running.close())
    return replace(content, digest=digest.text())


class _Names:
    """Names of the attachments and the metadata of a log, each to be there once at most."""

    def __init__(self, log: Log) -> None:
        forks = (fork_note(number) for number in range(1, len(log.forks) + 1))
        texts = (STDERR, PREDICTOR_STDERR, TRACEBACK)
        self._left = {
            Attachment: {*ATTACHMENTS, PACKED_SCENE, *texts},
            Metadata: {"run", RESULT, ASKED, CHECK, PLUGINS, *forks},
        }

    def fault_of(self, item: Item) -> Difference | None:
        """Return what is wrong with an item that is no message of ours."""
        if isinstance(item, Packet):
            return Difference(f"a message on {item.topic[:80]}", item.schema[:80], "one of ours")
        left = self._left[type(item)]
        if item.name in left:
            left.remove(item.name)
            return None
        kind = type(item).__name__.lower()
        return Difference(f"{kind} '{item.name[:80]}'", "in the file", "none, or not twice")


def _misplaced(item: Item, message: Message, log: Log) -> Difference | None:
    """Return where a message should be, if it is on another topic or of another time."""
    assert isinstance(item, Packet)
    topic = topic_of(message)
    forks = range(1, len(log.forks) + 1) if isinstance(message, pb.SensorInfo) else ()
    if item.topic in [f"{before(number)}{message.name}" for number in forks]:  # type: ignore[attr-defined]
        return None
    at, now = f"{item.topic[:80]} at {item.time_ns} ns", f"{topic} at {time_of(message)} ns"
    return None if at == now else Difference(f"{type(message).__name__.lower()}", at, now)


class _Running:
    """Running hashes of inputs."""

    def __init__(self, log: Log) -> None:
        self._log = log
        beams = (log.beams, *(fork.beams for fork in log.forks))
        self._sensors = {name for one in beams for name in one}
        names = [f"sensor/{name}" for name in sorted(self._sensors)]
        self._streams = StreamHashes([*names, *own_streams(log.config)])
        if log.config.prior_map:
            self._streams.update(PRIOR, log.config.prior_map)
        self._written: list[bytes] = []
        self._pose = b""
        self._goal: list[bytes] = []
        self._prediction: list[bytes] = []
        self._arrived: set[str] = set()

    def add(self, message: Message) -> None:
        if not isinstance(message, INPUTS):
            return
        data = serialized(message)
        if isinstance(message, pb.Sweep):
            if message.sensor not in self._sensors:
                name = message.sensor[:40]
                raise InputError(f"log '{self._log.path}': sweep of '{name}', not declared")
            self._written.append(data)
            self._arrived.add(message.sensor)
        elif isinstance(message, pb.Pose):
            self._pose = data
        elif isinstance(message, pb.Goal):
            if not self._log.has_goals:
                raise InputError(
                    f"log '{self._log.path}': a goal in it, but no recording or waypoints"
                )
            self._goal = [data]
        elif isinstance(message, pb.Prediction):
            if not is_outside(self._log.config.prediction.source):
                raise InputError(
                    f"log '{self._log.path}': a prediction in it, but no predictor from outside"
                )
            self._prediction = [data]
        self._streams.update(topic_of(message)[1:], data)

    def close(self) -> InputRecord:
        """Return the hashes of the inputs of one decision, and start the next."""
        hashes = {one.name: one.hash for one in self._streams.message(0, 0).streams}
        digest = inputs_digest([*self._written, self._pose, *self._goal, *self._prediction])
        record = InputRecord(digest, hashes, frozenset(self._arrived))
        self._written, self._arrived, self._goal, self._prediction = [], set(), [], []
        return record
