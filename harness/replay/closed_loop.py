"""Closed-loop check: the episode of a log simulated again and compared with the log."""

from __future__ import annotations

import itertools
import math
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

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
from wayproof.harness.recompute.moments import Moment, Observer
from wayproof.harness.recompute.rebuild import is_made_from_seed, made_otherwise, rebuild
from wayproof.harness.recompute.segments import segments_of
from wayproof.harness.replay.answers import RecordedAnswers, RecordedPredictions
from wayproof.harness.replay.fork import fork_with
from wayproof.harness.result import ends_in_error, is_recovered
from wayproof.harness.runner import run_episode
from wayproof.harness.schema import wayproof_pb2 as pb

SAME = 1e-9
"""Relative difference up to which two figures of a result are equal."""

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


@dataclass(frozen=True)
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
    identical: bool
    scene_from_seed: bool | None
    made_otherwise: tuple[Difference, ...]
    decisions: int
    simulated: int
    first_input: MessageDifference | None
    first_record: MessageDifference | None
    first_difference: int | None
    differences: tuple[Difference, ...]
    result: tuple[Difference, ...]
    elsewhere: tuple[Difference, ...]
    chain: str
    outcome: str
    recorded_outcome: str
    regenerated: bool
    written: str | None
    wall_time_s: float

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
    with tempfile.TemporaryDirectory() as folder:
        target = written or Path(folder) / "again.mcap"
        _simulate(log, target, Path(folder), observe)
        again = open_log(target, allow_plugins=True)
        compared = _compare(log, again)
    made = made_otherwise(log)
    result = tuple(_result_differences(log, again))
    return ClosedLoop(
        log=str(path),
        identical=compared.alike and not result and not made,
        scene_from_seed=not made if is_made_from_seed(log) else None,
        made_otherwise=tuple(made),
        decisions=compared.decisions,
        simulated=int(again.result["decisions"]),
        first_input=compared.first_input,
        first_record=compared.first_record,
        first_difference=compared.first_decision,
        differences=tuple(compared.differences),
        result=result,
        elsewhere=tuple(other_than_here(log.run)),
        chain=again.result["chain"],
        outcome=again.result["outcome"],
        recorded_outcome=log.result["outcome"],
        regenerated=log.record == "decisions",
        written=None if written is None else str(written),
        wall_time_s=time.perf_counter() - began,
    )


def _simulate(log: Log, target: Path, folder: Path, observe: Observer | None) -> None:
    """Write the episode again: the first segment from the start, then each fork.

    Each but the last stops at the decision at which the next begins: its own end is not in the log.
    """
    delays = _delays(log)
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

    def observe_own(moment: Moment) -> None:
        if moment.decision.sequence < end:
            observe(moment)

    return observe_own


def _answers(log: Log, end: int | None) -> RecordedAnswers | None:
    """Return the answers of a stack on trial before the end of a segment, then silence.

    Those from there on were given to the next segment, whose settings they may need.
    """
    return None if log.config.stack.name == BUILTIN else RecordedAnswers(log, silent_from=end)


def _delays(log: Log) -> dict[int, float]:
    """Return the delay of each decision, s; delays are inputs, and measured ones do not recur."""
    return {latency.sequence: latency.delay_s for latency in log.only(pb.Latency)}


@dataclass
class _Comparison:
    """Differences between two logs, up to the first decision that differs."""

    decisions: int = 0
    first_input: MessageDifference | None = None
    first_record: MessageDifference | None = None
    first_decision: int | None = None
    differences: list[Difference] = field(default_factory=list)

    @property
    def alike(self) -> bool:
        return (self.first_input, self.first_record, self.first_decision) == (None, None, None)


@dataclass(frozen=True)
class _Step:
    """A decision, if there is one, and the other messages of its number by topic."""

    number: int
    decision: pb.Decision | None
    others: Mapping[str, list[Message]]


def _compare(log: Log, again: Log) -> _Comparison:
    """Compare step by step, to the end of the log or to the first decision that differs."""
    found = _Comparison()
    thinned = log.record == "decisions"
    pairs = itertools.zip_longest(_steps(log.path), _steps(again.path))
    for old, new in pairs:
        if old is None:
            break  # the log's end is missing, or its result differs
        found.decisions += old.decision is not None
        if new is None:
            found.first_decision = found.first_decision or old.number
            found.differences = [Difference("decision", "is there", "the episode has ended")]
            break
        _compare_others(found, old, new, thinned)
        if old.decision is None or new.decision is None:
            continue
        if thinned and not old.decision.global_path:
            new.decision.ClearField("global_path")  # left out of the log; the chain covers it
        different = differences(old.decision, new.decision)
        if different:
            found.first_decision, found.differences = old.number, different
            found.decisions += sum(1 for one, _ in pairs if one and one.decision is not None)
            break
    return found


def _compare_others(found: _Comparison, old: _Step, new: _Step, thinned: bool) -> None:
    """Record the first input and the first other message that differ."""
    topics = [one for one in {**old.others, **new.others}]
    for topic in topics:
        one, other = old.others.get(topic, []), new.others.get(topic, [])
        if not one and thinned and is_regenerated(topic):
            continue
        different = _messages_differ(one, other)
        if not different:
            continue
        is_input = isinstance((one or other)[0], INPUTS)
        place = MessageDifference(topic, old.number, _time_of(old, one or other), tuple(different))
        if is_input and found.first_input is None:
            found.first_input = place
        elif not is_input and found.first_record is None:
            found.first_record = place


def _messages_differ(old: list[Message], new: list[Message]) -> list[Difference]:
    if len(old) != len(new):
        return [Difference("messages", str(len(old)), str(len(new)))]
    for one, other in zip(old, new, strict=True):
        if type(one) is not type(other):
            return [Difference("kind", type(one).__name__, type(other).__name__)]
        if found := message_differences(one, other):
            return found
    return []


def _time_of(step: _Step, messages: list[Message]) -> float:
    if step.number == BEFORE_ALL:
        return 0.0
    time_ns: int = messages[0].timestamp.ToNanoseconds()  # type: ignore[attr-defined]
    return time_ns * 1e-9


def _steps(path: Path) -> Iterator[_Step]:
    """Yield the messages by decision in file order, after the beam tables."""
    for number, messages in itertools.groupby(read_messages(path), _number_of):
        decision = None
        others: dict[str, list[Message]] = {}
        for message in messages:
            if isinstance(message, pb.Decision):
                decision = message
            else:
                others.setdefault(topic_of(message), []).append(message)
        yield _Step(number, decision, others)


def _number_of(message: Message) -> int:
    if isinstance(message, pb.SensorInfo):
        return BEFORE_ALL
    return int(message.sequence)  # type: ignore[attr-defined]


def _result_differences(log: Log, again: Log) -> Iterator[Difference]:
    """Yield the fields of the recorded result that differ."""
    if ends_in_error(log.result):
        if not is_recovered(log.result) and _ends_alike(log, again):
            yield Difference("result.outcome", log.result["outcome"], again.result["outcome"])
        return
    # The digest covers measured times, which no simulation reproduces.
    for name in sorted({*log.result, *again.result} - {"record", CONTENT}):
        then, now = log.result.get(name, "none"), again.result.get(name, "none")
        if not _same(then, now):
            yield Difference(f"result.{name}", then, now)


def _ends_alike(log: Log, again: Log) -> bool:
    """Return whether an episode that ended in an error ends by itself at the same decision."""
    return again.result["outcome"] != "error" and (
        again.result["decisions"] == log.result.get("decisions")
    )


def _same(then: str, now: str) -> bool:
    """Return whether two texts are equal, or equal numbers to nine digits."""
    if then == now:
        return True
    try:
        return math.isclose(float(then), float(now), rel_tol=SAME, abs_tol=SAME)
    except ValueError:
        return False
