"""Messages of a log for the checks of consistency, read in one pass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from google.protobuf.message import Message

from wayproof.harness.errors import InputError
from wayproof.harness.input_messages import inputs_digest, serialized
from wayproof.harness.log.codec.container import Packet, walk
from wayproof.harness.log.codec.messages import decode, is_ours
from wayproof.harness.log.copy import topic_of
from wayproof.harness.log.digest import ContentDigest
from wayproof.harness.log.reader import Log
from wayproof.harness.log.streams import PRIOR, StreamHashes, own_streams
from wayproof.harness.prediction_config import is_outside
from wayproof.harness.schema import wayproof_pb2 as pb

INPUTS = (pb.Sweep, pb.Pose, pb.Goal, pb.Prediction, pb.Latency, pb.StackCommand)
"""Messages that are hashed stream by stream."""


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
    digest: str = ""

    def add(self, message: Message) -> None:
        """Append a message, unless it is of another kind."""
        if isinstance(message, pb.Decision):
            self.decisions.append(message)
        elif isinstance(message, pb.Truth):
            self.truths.append(message)
        elif isinstance(message, pb.Streams):
            self.streams.append(message)
        elif isinstance(message, pb.Perturbation):
            self.perturbations.append(message)
        elif isinstance(message, pb.Pose):
            self.poses.append(message)
        elif isinstance(message, pb.Latency):
            self.latencies.append(message)
        elif isinstance(message, pb.Goal):
            self.goals.append(message)
        elif isinstance(message, pb.RecordedMotion):
            self.motions.append(message)


def read_content(log: Log) -> Content:
    """Read the messages of a log.

    Raises:
        InputError: The file breaks off or is damaged.
    """
    content, digest = Content(), ContentDigest()
    running = None if log.record == "decisions" else _Running(log)
    for item in walk(log.path):
        digest.add(item)
        if not (isinstance(item, Packet) and is_ours(item)):
            continue
        message = decode(item, log.path)
        content.add(message)
        if running is None:
            continue
        running.add(message)
        if isinstance(message, pb.Decision):
            content.inputs.append(running.close())
    return replace(content, digest=digest.text())


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
