"""Reading of logs: the head, and the records of decisions; damage is reported in one line."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

from google.protobuf.message import Message

from wayproof.harness.config import Config
from wayproof.harness.config_document import from_json
from wayproof.harness.errors import InputError, printable
from wayproof.harness.input_messages import inputs_from_messages
from wayproof.harness.inputs import Beams, Inputs
from wayproof.harness.log.codec.container import walk
from wayproof.harness.log.codec.messages import Kind, read_messages, read_only
from wayproof.harness.log.decision_messages import DecisionMessages
from wayproof.harness.log.head import Head, check_file, read_head
from wayproof.harness.log.writer import ASKED, PLUGINS, STDERR, TRACEBACK
from wayproof.harness.mission import Mission
from wayproof.harness.prediction_config import is_outside
from wayproof.harness.schema import wayproof_pb2 as pb

CHECK = "check"
"""Name of the metadata with the verdict of a counterfactual check."""

MOST_LINES = 400
"""Maximum number of lines of a traceback or of a standard error that are read."""

MOST_FORKS = 99
"""Maximum number of forks of one log."""

LONGEST_NS = 4000 * 10**9
"""Simulated time beyond every episode, ns: `episode.time_limit` is at most an hour."""

LONGEST_RECORDING_NS = 10 * 86_400 * 10**9
"""Time beyond every recording, ns: ten days."""


@dataclass(frozen=True)
class Record:
    """One decision of a log with its inputs and its delay.

    Attributes:
        inputs: Inputs of the decision.
        latency: Delay until the robot followed the decision.
        decision: The logged decision.
        state: State of the simulator to resume the episode with this decision, if it was kept.
        answer: Answer of a stack on trial that the decision was made with; None for the built-in.
        motion: Motion of a recording's robot up to this decision; None of an episode.
    """

    inputs: Inputs
    latency: pb.Latency
    decision: pb.Decision
    state: pb.State | None = None
    answer: pb.StackCommand | None = None
    motion: pb.RecordedMotion | None = None


@dataclass(frozen=True)
class Fork:
    """Settings of the decisions before a fork.

    Attributes:
        at: Number of the first decision after the fork.
        config: Settings before it.
        beams: Beam geometry before it, by sensor name.
        mission: Mission of the stack before it.
    """

    at: int
    config: Config
    beams: dict[str, Beams]
    mission: Mission


@dataclass(frozen=True)
class Log:
    """Head of a log, with access to its records.

    Attributes:
        path: Path of the file.
        config: Resolved config.
        mission: Mission of the stack.
        scene: Flattened MJCF; only a new simulation needs it.
        run: Versions and hashes.
        result: Outcome and figures.
        beams: Beam geometry by sensor name.
        forks: Forks, in order: decisions from which on the settings differ.
        check: Verdict of a counterfactual check, as metadata; empty without one.
        traceback: Traceback of an episode that ended as `error`; empty without one.
        stderr: End of what a stack in another process wrote to its standard error.
        plugins: SHA-256 of the file of each of the user's classes in use, by name.
        asked: Settings that the scenario resolved, as they were asked for, name -> JSON; empty of
            an episode without a scenario.
    """

    path: Path
    config: Config
    mission: Mission
    scene: str
    run: dict[str, str]
    result: dict[str, str]
    beams: dict[str, Beams]
    forks: tuple[Fork, ...] = ()
    check: dict[str, str] = field(default_factory=dict)
    traceback: str = ""
    stderr: str = ""
    plugins: dict[str, str] = field(default_factory=dict)
    asked: dict[str, str] = field(default_factory=dict)

    @property
    def under_way(self) -> bool:
        """Whether it is still being written, and may break off."""
        return False

    @property
    def fork(self) -> Fork | None:
        """Last fork; None without one."""
        return self.forks[-1] if self.forks else None

    def as_of(self, sequence: int) -> Log:
        """Return the log with the settings of a decision, as if they never changed afterwards."""
        forks = tuple(fork for fork in self.forks if fork.at <= sequence)
        if len(forks) == len(self.forks):
            return self
        last = self.forks[len(forks)]
        return replace(
            self, config=last.config, mission=last.mission, beams=last.beams, forks=forks
        )

    def messages(self, after_ns: int = -1) -> Iterator[Message]:
        """Yield every message after a simulated time in file order.

        Raises:
            InputError: The file breaks off or a checksum does not hold.
        """
        return read_messages(self.path, after_ns)

    def records(self, after: pb.Keyframe | None = None) -> Iterator[Record]:
        """Yield every decision with its inputs, in file order.

        Args:
            after: Keyframe after whose decision the first of them is; None for all.
        """
        for item in self._records_and_rest(after):
            if isinstance(item, Record):
                yield item

    def keyframes(self) -> list[pb.Keyframe]:
        """Return the keyframes in file order; none where the settings have none.

        Raises:
            InputError: The file breaks off, a checksum does not hold, or they are out of order.
        """
        if not any(one.keyframe_period for one in (self.config, *(f.config for f in self.forks))):
            return []
        keyframes = list(self.only(pb.Keyframe))
        for before, one in itertools.pairwise(keyframes):
            if one.sequence <= before.sequence:
                raise InputError(
                    f"log '{self.path}': keyframe after decision {one.sequence}, expected one "
                    f"after {before.sequence}"
                )
        return keyframes

    def records_with_truth(self) -> Iterator[tuple[Record, pb.Truth]]:
        """Yield every decision with its inputs and the ground truth that follows it in the log.

        Of a recording, which has no truth, the recorded motion stands for it, see `as_truth`.

        Raises:
            InputError: A decision has no truth.
        """
        record = None
        for item in self._records_and_rest():
            if isinstance(item, Record):
                if item.motion is not None:
                    yield item, as_truth(item.motion)
                    continue
                if record is not None:
                    break
                record = item
            elif isinstance(item, pb.Truth) and record is not None:
                if item.sequence == record.decision.sequence:
                    yield record, item
                    record = None
        if record is not None and not self.under_way:
            sequence = record.decision.sequence
            raise InputError(f"log '{self.path}': decision {sequence} without its truth")

    def check_sweeps(self) -> None:
        """Raise an InputError if the sweeps were left out of the log."""
        if self.record == "decisions":
            raise InputError(
                f"log '{self.path}': its sweeps were left out (record = '{self.config.record}'); "
                "wayproof replay simulate --log FILE writes them again"
            )

    def _records_and_rest(self, after: pb.Keyframe | None = None) -> Iterator[Record | Message]:
        """Yield the records, and the messages that belong to none, in file order."""
        self.check_sweeps()
        given = DecisionMessages()
        count, time_ns = 0, -1
        if after is not None:
            count, time_ns = after.sequence + 1, after.timestamp.ToNanoseconds()
        for message in self.messages(time_ns):
            if isinstance(message, pb.Prediction):
                self._check_prediction(message, count)
            if given.take(message):
                continue
            if not isinstance(message, pb.Decision):
                yield message
                continue
            inputs = inputs_from_messages(
                given.pose,
                given.sweeps,
                goal=given.goal if self.has_goals else None,
                prediction=given.prediction,
            )
            self._check_order(inputs, count, time_ns)
            answer = given.answer
            if answer is not None and answer.sequence != count:
                answer = None  # of another decision: this one has none
            yield Record(
                inputs=inputs,
                latency=given.latency,
                decision=message,
                state=given.state,
                answer=answer,
                motion=given.motion,
            )
            given = given.next()
            count, time_ns = count + 1, inputs.time_ns

    def _check_prediction(self, message: pb.Prediction, count: int) -> None:
        """Check that a prediction is an input of the next decision."""
        if message.sequence != count or not is_outside(self.config.prediction.source):
            raise InputError(
                f"log '{self.path}': a prediction for decision {message.sequence} before decision "
                f"{count}, expected it before its own, and with a predictor from outside"
            )

    @property
    def has_goals(self) -> bool:
        """Whether each decision has a goal of its own: of a recording, or of several goals."""
        return self.config.recording is not None or bool(self.mission.waypoints)

    @property
    def record(self) -> str:
        """Extent of the log: `full` or `decisions`."""
        return self.result.get("record", "full")

    def decisions(self) -> Iterator[pb.Decision]:
        """Return every decision without its inputs."""
        return self.only(pb.Decision)

    def _check_order(self, inputs: Inputs, count: int, before_ns: int) -> None:
        """Check that decisions count from 0 and that simulated time increases."""
        longest = LONGEST_NS if self.config.recording is None else LONGEST_RECORDING_NS
        if inputs.sequence != count or not before_ns < inputs.time_ns < longest:
            raise InputError(
                f"log '{self.path}': decision {inputs.sequence} at {inputs.time_ns} ns, expected "
                f"{count} after {before_ns} ns"
            )
        if self.has_goals and inputs.goal is None:
            raise InputError(f"log '{self.path}': decision {inputs.sequence} without its goal")
        for sweep in inputs.sweeps:
            if sweep.sensor not in self.beams:
                raise InputError(f"log '{self.path}': sweep of '{sweep.sensor[:40]}', not declared")

    def motions(self) -> Iterator[pb.RecordedMotion]:
        """Yield the recorded motion up to each decision; none of an episode."""
        return self.only(pb.RecordedMotion)

    def truth(self) -> Iterator[pb.Truth]:
        """Yield the ground truth of each decision, for scoring."""
        return self.only(pb.Truth)

    def only(self, kind: type[Kind]) -> Iterator[Kind]:
        """Yield the messages of one kind in file order.

        Raises:
            InputError: The file breaks off or a checksum does not hold.
        """
        if self.under_way:  # which is read but once, as it grows
            return (one for one in self.messages() if isinstance(one, kind))
        return read_only(self.path, kind)


def as_truth(motion: pb.RecordedMotion) -> pb.Truth:
    """Return the recorded motion in place of a truth, to show it; its clearance is NaN."""
    return pb.Truth(
        timestamp=motion.timestamp,
        sequence=motion.sequence,
        position=motion.position,
        quaternion=motion.quaternion,
        velocity=motion.velocity,
        clearance_m=math.nan,
    )


def open_log(path: Path, allow_plugins: bool = False) -> Log:
    """Read the head of a finished log; every checksum of the file's bytes is recomputed.

    Args:
        path: Path of the file.
        allow_plugins: Whether code that its config names may be imported.

    Raises:
        InputError: No such file, no MCAP, truncated, of another format, or not ours.
    """
    check_file(path)
    head = read_head(walk(path, head_only=True), path, allow_plugins)
    if "result" not in head.metadata:
        raise InputError(f"log '{path}': an MCAP file, but not a finished Wayproof log")
    result = head.metadata["result"]
    missing = [name for name in ("outcome", "chain") if name not in result]
    if missing:
        raise InputError(f"log '{path}': no {', '.join(missing)} in its result")
    forks = _read_forks(head, path, allow_plugins)
    return Log(
        path=path,
        config=head.config,
        mission=head.mission,
        scene=head.scene,
        run=head.run,
        result=result,
        beams=head.beams,
        forks=forks,
        check=head.metadata.get(CHECK, {}),
        traceback=_text(head, TRACEBACK),
        stderr=_text(head, STDERR),
        plugins=head.metadata.get(PLUGINS, {}),
        asked=head.metadata.get(ASKED, {}),
    )


def _text(head: Head, name: str) -> str:
    """Return the end of a text in the file with control characters escaped, line by line."""
    text = head.attachments.get(name, b"").decode(errors="replace")
    return "\n".join(map(printable, text.splitlines()[-MOST_LINES:]))


def before(number: int) -> str:
    """Return the prefix of the topics of the beam tables before a fork, counted from 1."""
    return "/before/" if number == 1 else f"/before {number}/"


def fork_note(number: int) -> str:
    """Return the name of the metadata of a fork, counted from 1."""
    return "fork" if number == 1 else f"fork {number}"


def _read_forks(head: Head, path: Path, allow_plugins: bool) -> tuple[Fork, ...]:
    forks: list[Fork] = []
    while fields := head.metadata.get(fork_note(len(forks) + 1)):
        at = fields.get("at", "")
        least = forks[-1].at if forks else 0
        if not at.isdecimal() or len(at) > 9 or int(at) < least or len(forks) == MOST_FORKS:
            raise InputError(
                f"log '{path}': forked at {at[:20]!r}, expected a decision's number from {least} on"
            )
        config = from_json(fields.get("config", "").encode(), allow_plugins)
        mission = Mission.from_json(fields.get("mission", "").encode())
        beams = head.before.get(before(len(forks) + 1), {})
        forks.append(Fork(int(at), config, beams, mission))
    return tuple(forks)
