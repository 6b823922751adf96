"""Closed-loop check: the episode of a log simulated again and compared with the log."""

from __future__ import annotations

import itertools
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from google.protobuf.message import Message

from wayproof.harness.config import BUILTIN
from wayproof.harness.decision import Difference, differences, message_differences
from wayproof.harness.errors import InputError
from wayproof.harness.log.codec.messages import read_messages, topic_of
from wayproof.harness.log.digest import CONTENT
from wayproof.harness.log.machine import other_than_here
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.log.writer import is_regenerated
from wayproof.harness.prediction_config import is_outside
from wayproof.harness.recompute.moments import Observer, segments_of
from wayproof.harness.recompute.rebuild import is_made_from_seed, made_otherwise, rebuild
from wayproof.harness.replay.answers import RecordedAnswers, RecordedPredictions
from wayproof.harness.replay.consistency.messages import is_number, number_of
from wayproof.harness.replay.fork import fork_with
from wayproof.harness.result import ends_in_error, is_recovered
from wayproof.harness.runner import run_episode
from wayproof.harness.schema import wayproof_pb2 as pb

INPUTS: tuple[type[Message], ...] = (
    *(pb.SensorInfo, pb.Sweep, pb.Pose, pb.Goal, pb.Prediction, pb.Latency, pb.StackCommand),
)

BEFORE_ALL = -1
"""Number of the step that holds the beam tables."""


@dataclass(frozen=True)
class MessageDifference:
    """First message of a kind that differs.

    Attributes:
        stream: Topic.
        sequence: Number of its decision; -1 for a beam table.
        time_s: Simulated time.
        differences: Differences in it, value by value.
    """

    stream: str
    sequence: int
    time_s: float
    differences: tuple[Difference, ...]


@dataclass
class ClosedLoop:
    """Comparison of an episode simulated again with its recording.

    Attributes:
        log: The log's path.
        identical: Whether all is the same: beam tables, inputs, decisions, truth, states, stream
            hashes, perturbation records, result, and the scene that the seed generates.
        scene_from_seed: Whether this version generates the same scene, mission and config from the
            seed; None if world or robot is a file. The simulated scene is always that of the log.
        made_otherwise: Differences in them.
        decisions: Number of decisions in the log.
        simulated: Number of decisions of the new episode; more if the end of the log is missing.
        first_input: First input that differs, if any.
        first_record: First other message but decisions that differs, if any.
        first_difference: Number of the first decision that differs, if any.
        differences: Differences in it, value by value.
        result: Fields of the result that differ; not compared if the end of the log is missing.
        elsewhere: Fields of the recording machine and software that differ here.
        chain: Hash over the new decisions.
        outcome: Outcome of the new episode.
        recorded_outcome: Outcome in the log.
        regenerated: Whether the log lacks its sweeps.
        written: Path of the new log, if it was kept.
        wall_time_s: Wall time, s.
    """

    log: str
    recorded_outcome: str
    regenerated: bool
    elsewhere: tuple[Difference, ...]
    written: str | None
    identical: bool = False
    scene_from_seed: bool | None = None
    made_otherwise: tuple[Difference, ...] = ()
    decisions: int = 0
    simulated: int = 0
    first_input: MessageDifference | None = None
    first_record: MessageDifference | None = None
    first_difference: int | None = None
    differences: tuple[Difference, ...] = ()
    result: tuple[Difference, ...] = ()
    chain: str = ""
    outcome: str = ""
    wall_time_s: float = 0.0

    @property
    def findings(self) -> list[Difference]:
        """Return all differences in one list, each with its place in the log."""
        found = list(self.made_otherwise)
        for one in (self.first_input, self.first_record):
            if one is not None:
                place = f"{one.stream}[{one.sequence}]"
                found += [
                    Difference(f"{place}.{each.field}", each.recorded, each.recomputed)
                    for each in one.differences
                ]
        found += [
            Difference(
                f"/decision[{self.first_difference}].{each.field}", each.recorded, each.recomputed
            )
            for each in self.differences
        ]
        return [*found, *self.result]


def simulate_again(
    path: Path,
    allow_plugins: bool = False,
    written: Path | None = None,
    observe: Observer | None = None,
) -> ClosedLoop:
    """Simulate the episode of a log again from its seed, config and scene, fork by fork.

    Args:
        path: The log.
        allow_plugins: Whether code that its config names may be imported.
        written: Path to keep the new log at, in full.
        observe: Called with each decision after it was made.

    Raises:
        InputError: There is no such log, or it cannot be simulated.
    """
    log = open_log(path, allow_plugins)
    if written is not None and written.resolve() == path.resolve():
        raise InputError(f"--log {written}: the log itself, expected another name")
    began = time.perf_counter()
    found = ClosedLoop(
        log=str(path),
        recorded_outcome=log.result["outcome"],
        regenerated=log.record == "decisions",
        elsewhere=tuple(other_than_here(log.run)),
        written=None if written is None else str(written),
    )
    with tempfile.TemporaryDirectory() as folder:
        target = written or Path(folder) / "again.mcap"
        _simulate(log, target, Path(folder), observe)
        again = open_log(target, allow_plugins=True)
        _compare(found, log, again)
    found.made_otherwise = tuple(made_otherwise(log))
    found.result = tuple(_result_differences(log, again))
    found.identical = not found.findings
    found.scene_from_seed = not found.made_otherwise if is_made_from_seed(log) else None
    found.simulated = int(again.result["decisions"])
    found.chain, found.outcome = again.result["chain"], again.result["outcome"]
    found.wall_time_s = time.perf_counter() - began
    return found


def _simulate(log: Log, target: Path, folder: Path, observe: Observer | None) -> None:
    """Write the episode again: the first segment from the start, then each fork.

    Each but the last stops at the decision at which the next begins: its own end is not in the log.
    """
    # Delays are inputs, and measured ones do not recur.
    delays = {latency.sequence: latency.delay_s for latency in log.only(pb.Latency)}
    forks = segments_of(log)[1:]
    ends = [*(run.begin for run in forks), None]
    steps = [folder / f"{number}.mcap" for number in range(len(forks))] + [target]
    predictions = RecordedPredictions(log) if is_outside(log.config.prediction.source) else None
    scenario = rebuild(log.as_of(BEFORE_ALL))
    run_episode(
        scenario,
        steps[0],
        _before(ends[0], observe),
        delays=delays,
        record="full",
        session=_answers(log, ends[0]),
        predictions=predictions,
        until=ends[0],
    )
    for run, end, before, after in zip(forks, ends[1:], steps[:-1], steps[1:], strict=True):
        parent = open_log(before, allow_plugins=True)
        fork_with(
            parent,
            run.begin,
            run.config,
            after,
            _before(end, observe),
            delays=delays,
            record="full",
            session=_answers(log, end),
            predictions=predictions,
            until=end,
        )


def _before(end: int | None, observe: Observer | None) -> Observer | None:
    """Return an observer of the decisions of a segment: the last one made is the next segment's."""
    if observe is None or end is None:
        return observe
    return lambda moment: observe(moment) if moment.decision.sequence < end else None


def _answers(log: Log, end: int | None) -> RecordedAnswers | None:
    """Return the answers of a stack on trial before the end of a segment, then silence.

    Those from there on were given to the next segment, whose settings they may need.
    """
    return None if log.config.stack.name == BUILTIN else RecordedAnswers(log, silent_from=end)


Step = dict[str, list[Message]]
"""Messages of one number by topic."""

DECISION = "/decision"


def _compare(found: ClosedLoop, log: Log, again: Log) -> None:
    """Compare step by step, to the end of the log or to the first decision that differs."""
    thinned = log.record == "decisions"
    pairs = itertools.zip_longest(_steps(log.path), _steps(again.path))
    for old, new in pairs:
        if old is None:
            break  # the log's end is missing, or its result differs
        number, then = old
        found.decisions += DECISION in then
        if new is None:
            found.first_difference = number
            found.differences = (Difference("decision", "is there", "the episode has ended"),)
            break
        _compare_step(found, number, then, new[1], thinned)
        if found.first_difference is not None:
            found.decisions += sum(1 for one, _ in pairs if one and DECISION in one[1])
            break


def _compare_step(found: ClosedLoop, number: int, old: Step, new: Step, thinned: bool) -> None:
    """Record the first input, the first other message and the decision that differ."""
    for topic in {**old, **new}:
        one, other = old.get(topic, []), new.get(topic, [])
        if not one and thinned and is_regenerated(topic):
            continue
        if topic == DECISION:
            if thinned and one and other and not one[0].global_path:  # type: ignore[attr-defined]
                other[0].ClearField("global_path")  # left out of the log; the chain covers it
            if one and other and (different := _messages_differ(one, other, differences)):
                found.first_difference, found.differences = number, tuple(different)
            continue
        different = _messages_differ(one, other, message_differences)
        if not different:
            continue
        message = (one or other)[0]
        at = 0 if number == BEFORE_ALL else message.timestamp.ToNanoseconds()  # type: ignore[attr-defined]
        place = MessageDifference(topic, number, at * 1e-9, tuple(different))
        if isinstance(message, INPUTS):
            found.first_input = found.first_input or place
        else:
            found.first_record = found.first_record or place


def _messages_differ(
    old: list[Message], new: list[Message], compare: Callable[[Any, Any], list[Difference]]
) -> list[Difference]:
    if len(old) != len(new):
        return [Difference("messages", str(len(old)), str(len(new)))]
    for one, other in zip(old, new, strict=True):
        if type(one) is not type(other):
            return [Difference("kind", type(one).__name__, type(other).__name__)]
        if found := compare(one, other):
            return found
    return []


def _steps(path: Path) -> Iterator[tuple[int, Step]]:
    """Yield the messages by decision in file order, after the beam tables."""

    def number_of(message: Message) -> int:
        if isinstance(message, pb.SensorInfo):
            return BEFORE_ALL
        return int(message.sequence)  # type: ignore[attr-defined]

    for number, messages in itertools.groupby(read_messages(path), number_of):
        step: Step = {}
        for message in messages:
            step.setdefault(topic_of(message), []).append(message)
        yield number, step


def _result_differences(log: Log, again: Log) -> Iterator[Difference]:
    """Yield the fields of the recorded result that differ."""
    if ends_in_error(log.result):
        same_end = again.result["decisions"] == log.result.get("decisions")
        if not is_recovered(log.result) and same_end and again.result["outcome"] != "error":
            yield Difference("result.outcome", log.result["outcome"], again.result["outcome"])
        return  # an episode that ended in an error does not end by itself at the same decision
    # The digest covers measured times, which no simulation reproduces.
    for name in sorted({*log.result, *again.result} - {"record", CONTENT}):
        then, now = log.result.get(name, "none"), again.result.get(name, "none")
        if not _same(then, now):
            yield Difference(f"result.{name}", then, now)


def _same(then: str, now: str) -> bool:
    """Return whether two texts are equal, or equal numbers to nine digits."""
    value = number_of(then)
    return then == now or (value is not None and is_number(now, value))
