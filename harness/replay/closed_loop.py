"""Simulating a log's episode anew, from its seed, and comparing all that a log holds of it."""

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
from wayproof.harness.errors import InputError
from wayproof.harness.interface.types import Observation, Task
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.copy import topic_of
from wayproof.harness.log.digest import CONTENT
from wayproof.harness.log.machine import other_than_here
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.log.writer import is_regenerated
from wayproof.harness.recompute.rebuild import is_made_from_seed, made_otherwise, rebuild
from wayproof.harness.recompute.segments import segments_of
from wayproof.harness.replay.fork import fork_with
from wayproof.harness.result import ends_in_error
from wayproof.harness.runner import run_episode
from wayproof.harness.schema import stack_pb2 as sb
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.decision import Difference, differences, message_differences

SAME = 1e-9
"""Relative difference of a result's figures that are the same."""

INPUTS: tuple[type[Message], ...] = (pb.SensorInfo, pb.Sweep, pb.Pose, pb.Latency, pb.StackCommand)

BEFORE_ALL = -1
"""Number of the step that holds the sensors' tables."""


@dataclass(frozen=True)
class MessageDifference:
    """The first message of some kind that differs.

    Attributes:
        stream: Its topic.
        sequence: Of the decision that it belongs to; -1 of a sensor's table.
        time_s: Simulated time.
        differences: What differs in it, value by value.
    """

    stream: str
    sequence: int
    time_s: float
    differences: tuple[Difference, ...]


@dataclass(frozen=True)
class ClosedLoop:
    """How an episode simulated anew compares with its recording.

    Attributes:
        log: The log's path.
        identical: All that was compared is the same: sensor tables, inputs, decisions, truth,
            states, stream hashes, perturbation records, result, and the scene that the seed gives.
        scene_from_seed: This version makes the same scene, mission and config from the seed; none
            if world or robot is a file. What is simulated is the log's own scene in any case.
        made_otherwise: What differs in them.
        decisions: In the log.
        simulated: Decisions of the new episode; of a log whose end is missing it may have more.
        first_input: The first input that differs, if any.
        first_record: The first message that differs of those that are no input and no decision.
        first_difference: Sequence number of the first decision that differs, if any.
        differences: What differs there, value by value.
        result: Fields of the result that differ; not compared where the log's end is missing.
        elsewhere: What the log was recorded with that is different here.
        chain: Hash over the new decisions.
        not_compared: Fields of decisions that the log's older format gave otherwise.
        outcome: How the episode ended now.
        recorded_outcome: How it ended then.
        regenerated: Whether the log had left its sweeps out.
        written: Where the new log lies, if it was kept.
        wall_time_s: Time that it took.
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
    not_compared: tuple[str, ...]
    outcome: str
    recorded_outcome: str
    regenerated: bool
    written: str | None
    wall_time_s: float

    @property
    def findings(self) -> list[Difference]:
        """All that differs, in one list, each by its place in the log."""
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
    path: Path, allow_plugins: bool = False, written: Path | None = None
) -> ClosedLoop:
    """Simulate a log's episode from its seed, config and scene; a forked one fork by fork.

    Args:
        path: The log.
        allow_plugins: Whether code that its config names may be imported.
        written: Where to keep the new log; it is written in full.

    Raises:
        InputError: No such log, or one that cannot be simulated.
    """
    log = open_log(path, allow_plugins)
    if written is not None and written.resolve() == path.resolve():
        raise InputError(f"--log {written}: the log itself, expected another name")
    began = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        target = written or Path(folder) / "again.mcap"
        _simulate(log, target, Path(folder))
        again = open_log(target, allow_plugins=True)
        compared = _compare(log, again)
    made = made_otherwise(log)
    result = () if ends_in_error(log.result) else tuple(_result_differences(log, again))
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
        not_compared=log.not_compared,
        outcome=again.result["outcome"],
        recorded_outcome=log.result["outcome"],
        regenerated=log.record == "decisions",
        written=None if written is None else str(written),
        wall_time_s=time.perf_counter() - began,
    )


def _simulate(log: Log, target: Path, folder: Path) -> None:
    """Write the episode anew: the first settings from the start, then each fork from its own."""
    delays = _delays(log)
    forks = segments_of(log)[1:]
    steps = [folder / f"{number}.mcap" for number in range(len(forks))] + [target]
    answers = None if log.config.stack.name == BUILTIN else RecordedAnswers(log)
    scenario = rebuild(log.as_of(BEFORE_ALL))
    run_episode(scenario, steps[0], delays=delays, record="full", session=answers)
    for run, before, after in zip(forks, steps[:-1], steps[1:], strict=True):
        parent = open_log(before, allow_plugins=True)
        fork_with(parent, run.begin, run.config, after, delays=delays, record="full")


class RecordedAnswers:
    """The answers of a log in place of the stack that gave them: nothing in a log is run."""

    def __init__(self, log: Log) -> None:
        """Read them all."""
        self._commands = {
            message.sequence: message.command
            for message in read_messages(log.path)
            if isinstance(message, pb.StackCommand)
        }

    def start(self, task: Task) -> None:
        """Nothing to start."""

    def ask(self, observation: Observation) -> sb.Command:
        """The recorded answer to an observation of this number.

        Raises:
            InputError: The log has none.
        """
        if observation.sequence not in self._commands:
            raise InputError(f"decision {observation.sequence}: no answer of the stack in the log")
        return sb.Command.FromString(self._commands[observation.sequence])

    def close(self) -> None:
        """Nothing to end."""

    def stderr(self) -> str:
        """Nothing."""
        return ""


def _delays(log: Log) -> dict[int, float]:
    """What each decision's latency was: it is an input, and a measured one never comes again."""
    return {
        message.sequence: message.delay_s
        for message in read_messages(log.path)
        if isinstance(message, pb.Latency)
    }


@dataclass
class _Comparison:
    """Where two logs part, as far as they were compared."""

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
    """A decision, if one was made, and the other messages of its number by topic."""

    number: int
    decision: pb.Decision | None
    others: Mapping[str, list[Message]]


def _compare(log: Log, again: Log) -> _Comparison:
    """Step by step, to the end of the log or to the first decision that differs."""
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
        different = differences(old.decision, new.decision, log.not_compared)
        if different:
            found.first_decision, found.differences = old.number, different
            found.decisions += sum(1 for one, _ in pairs if one and one.decision is not None)
            break
    return found


def _compare_others(found: _Comparison, old: _Step, new: _Step, thinned: bool) -> None:
    """Note the first input and the first other message that differ."""
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
    """Messages by the number of their decision, in file order; sensors' tables come first."""
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
    """Fields of the recorded result that the new one has otherwise; an older log has fewer."""
    for name, now in again.result.items():
        then = log.result.get(name)
        # The digest covers measured times, which no simulation gives again.
        if name in ("record", CONTENT) or name in log.not_compared:
            continue
        if then is not None and not _same(then, now):
            yield Difference(f"result.{name}", then, now)


def _same(then: str, now: str) -> bool:
    """Whether two texts are the same, or the same number to its ninth digit."""
    if then == now:
        return True
    try:
        return math.isclose(float(then), float(now), rel_tol=SAME, abs_tol=SAME)
    except ValueError:
        return False
