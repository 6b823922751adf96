"""Simulating a log's episode anew, from its seed, and comparing what was sensed and decided."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from google.protobuf.message import Message

from harness.episode import run_episode
from harness.errors import InputError
from harness.evidence.rebuild import rebuild, scene_is_ours
from harness.logs.log_copy import topic_of
from harness.logs.messages import read_messages
from harness.logs.reader import Log, open_log
from harness.schema import wayproof_pb2 as pb
from harness.stack.decision import Difference, differences


@dataclass(frozen=True)
class InputDifference:
    """The first input that differs.

    Attributes:
        stream: Its topic.
        sequence: Of the decision that it is an input of.
        time_s: Simulated time.
    """

    stream: str
    sequence: int
    time_s: float


@dataclass(frozen=True)
class ClosedLoop:
    """How an episode simulated anew compares with its recording.

    Attributes:
        log: The log's path.
        identical: Every input in the log, every decision and the chain are the same bits.
        scene_from_seed: This version makes the same scene from the seed; none if the world is a
            file. What is simulated is the log's own scene in any case.
        decisions: In the log.
        first_input: The first input that differs, if any.
        first_difference: Sequence number of the first decision that differs, if any.
        differences: What differs there, value by value.
        chain: Hash over the new decisions.
        outcome: How the episode ended now.
        recorded_outcome: How it ended then.
        regenerated: Whether the log had left its sweeps out.
        written: Where the new log lies, if it was kept.
        wall_time_s: Time that it took.
    """

    log: str
    identical: bool
    scene_from_seed: bool | None
    decisions: int
    first_input: InputDifference | None
    first_difference: int | None
    differences: tuple[Difference, ...]
    chain: str
    outcome: str
    recorded_outcome: str
    regenerated: bool
    written: str | None
    wall_time_s: float


def simulate_again(
    path: Path, allow_plugins: bool = False, written: Path | None = None
) -> ClosedLoop:
    """Simulate a log's episode from its seed, config and scene.

    Args:
        path: The log.
        allow_plugins: Whether code that its config names may be imported.
        written: Where to keep the new log; it is written in full.

    Raises:
        InputError: No such log, a forked one, or one that cannot be simulated.
    """
    log = open_log(path, allow_plugins)
    if log.fork is not None:
        raise InputError(f"log '{path}': forked at {log.fork.at}, expected the log forked from")
    if written is not None and written.resolve() == path.resolve():
        raise InputError(f"--log {written}: the log itself, expected another name")
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        target = written or Path(folder) / "again.mcap"
        result = run_episode(rebuild(log), target, delays=_delays(log), record="full")
        first_input, first, found = _compare(log, target)
    return ClosedLoop(
        log=str(path),
        identical=first_input is None and first is None and result.chain == log.result["chain"],
        scene_from_seed=scene_is_ours(log),
        decisions=result.decisions,
        first_input=first_input,
        first_difference=first,
        differences=tuple(found),
        chain=result.chain,
        outcome=result.outcome,
        recorded_outcome=log.result["outcome"],
        regenerated=log.record == "decisions",
        written=None if written is None else str(written),
        wall_time_s=time.perf_counter() - began,
    )


def _delays(log: Log) -> dict[int, float]:
    """What each decision's latency was: it is an input, and a measured one never comes again."""
    return {
        message.sequence: message.delay_s
        for message in read_messages(log.path)
        if isinstance(message, pb.Latency)
    }


def _compare(log: Log, again: Path) -> tuple[InputDifference | None, int | None, list[Difference]]:
    """The first input, and the first decision with its differences, that are not as recorded."""
    first_input = None
    new_log = open_log(again, allow_plugins=True)
    regenerated = log.record == "decisions"
    pairs = zip(_steps(log.path), _steps(new_log.path), strict=False)
    for (inputs, decision), (new_inputs, new_decision) in pairs:
        if first_input is None:
            first_input = _input_difference(inputs, new_inputs, decision, regenerated)
        if regenerated and not decision.guide:
            new_decision.ClearField("guide")  # left out of the log; the chain vouches for it
        found = differences(decision, new_decision)
        if found:
            return first_input, decision.sequence, found
    return first_input, None, []


def _input_difference(
    old: dict[str, bytes], new: dict[str, bytes], decision: pb.Decision, regenerated: bool
) -> InputDifference | None:
    streams = [name for name in {**old, **new} if name in old or not regenerated]
    for stream in streams:
        if old.get(stream) != new.get(stream):
            time_s = decision.timestamp.ToNanoseconds() * 1e-9
            return InputDifference(stream, decision.sequence, time_s)
    return None


def _steps(path: Path) -> Iterator[tuple[dict[str, bytes], pb.Decision]]:
    """Each decision with the bytes of its inputs, by topic."""
    inputs: dict[str, bytes] = {}
    for message in read_messages(path):
        if isinstance(message, pb.Decision):
            yield inputs, message
            inputs = {}
        elif isinstance(message, INPUTS):
            inputs[topic_of(message)] = message.SerializeToString(deterministic=True)


INPUTS: tuple[type[Message], ...] = (pb.SensorInfo, pb.Sweep, pb.Pose, pb.Latency)
