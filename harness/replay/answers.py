"""Answers in place of a live stack's or predictor's: a log's, or those of a restarted stack.

A restarted stack is queried on recorded inputs, and its answers are compared with those then.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path

from wayproof.harness.config import BUILTIN
from wayproof.harness.decision import Difference, message_differences
from wayproof.harness.errors import InputError
from wayproof.harness.inputs import Inputs
from wayproof.harness.interface.connect import Session, connect, start_session
from wayproof.harness.interface.errors import StackError
from wayproof.harness.interface.observations import task_of
from wayproof.harness.interface.trial import TrialNavigator
from wayproof.harness.interface.types import Observation, Task
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import Log, Record, open_log
from wayproof.harness.recompute.moments import segments_of
from wayproof.harness.recompute.side_by_side import recompute
from wayproof.harness.schema import stack_pb2 as sb
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.prediction import Predicted
from wayproof.maps.columns import ColumnMap


class RecordedAnswers:
    """The answers of a log as a session, in place of the stack that gave them: nothing is run."""

    def __init__(self, log: Log, silent_from: int | None = None) -> None:
        """Read them all.

        Args:
            log: Log of a stack on trial.
            silent_from: Number of the decision from which on the stack is silent: its answers have
                no motion, so the body continues to its rest. By default it never is.
        """
        self._silent_from = silent_from
        self._commands = {one.sequence: one.command for one in log.only(pb.StackCommand)}

    def start(self, task: Task) -> None:
        """Do nothing: no stack is run."""

    def announce(self) -> None:
        """Do nothing: the answers are there."""

    def query(self, observation: Observation) -> sb.Command:
        """Return the recorded answer to an observation of this number.

        Raises:
            InputError: The log has none.
        """
        sequence = observation.sequence
        if self._silent_from is not None and sequence >= self._silent_from:
            return sb.Command(sequence=sequence)
        if sequence not in self._commands:
            raise InputError(f"decision {sequence}: no answer of the stack in the log")
        return sb.Command.FromString(self._commands[sequence])

    def close(self) -> None:
        """Do nothing: no stack is run."""

    def stderr(self) -> str:
        """Return nothing: no stack is run."""
        return ""


class RecordedPredictions:
    """The predictions of a log, in place of the predictor that made them: nothing is run."""

    def __init__(self, log: Log) -> None:
        """Read them all."""
        self._messages = {one.sequence: one for one in log.only(pb.Prediction)}

    def of(
        self, measured: ColumnMap, newest: Inputs, sequence: int, time_ns: int
    ) -> Predicted | None:
        """Return the recorded prediction of this number; None past the end of the log."""
        message = self._messages.get(sequence)
        return None if message is None else Predicted(message, 0.0)


@dataclass
class RestartedStack:
    """A stack restarted for a log, and a comparison of its answers with the recorded ones.

    Attributes:
        log: The log's path.
        stack: Name of the stack.
        session: The stack, started with the task of the log.
        answers: Answers compared.
        differing: Answers that differ.
        first_difference: Number of the first of them; none if all are alike.
        differences: Differences there, value by value.
    """

    log: str
    stack: str
    session: Session
    answers: int = 0
    differing: int = 0
    first_difference: int | None = None
    differences: list[Difference] = field(default_factory=list)

    @property
    def identical(self) -> bool:
        """Whether every answer is the recorded one, bit by bit."""
        return not self.differing

    def document(self) -> dict[str, object]:
        """Return the comparison by name, for JSON."""
        shown = {k: v for k, v in vars(self).items() if k not in ("session", "differences")}
        found = [asdict(one) for one in self.differences]
        return {**shown, "identical": self.identical, "differences": found}

    def query(self, navigator: TrialNavigator, record: Record) -> None:
        """Query the stack on the inputs of a decision, with the recorded answers before it.

        Args:
            navigator: Navigator before that decision, with the session.
            record: The decision.

        Raises:
            InputError: The log has no answer there, or the stack fails.
        """
        sequence = record.decision.sequence
        if record.answer is None:
            raise InputError(f"log '{self.log}': decision {sequence} without an answer")
        try:
            answer = navigator.query(record.inputs)
        except StackError as failure:
            raise InputError(f"{failure} at decision {sequence}") from failure
        recorded = sb.Command.FromString(record.answer.command)
        found = message_differences(recorded, sb.Command.FromString(answer.command))
        self.answers += 1
        if found:
            self.differing += 1
            if self.first_difference is None:
                self.first_difference, self.differences = sequence, found


@contextlib.contextmanager
def restarted_stack(log: Log, stack: str) -> Iterator[RestartedStack]:
    """Start a stack with the task of a log, and close it in the end.

    Args:
        log: Log of a stack on trial.
        stack: As `--stack` takes it; it is run.

    Raises:
        InputError: The log's stack was not on trial, or the stack cannot be started.
    """
    if log.config.stack.name == BUILTIN or stack == BUILTIN:
        what = "a log of the built-in stack" if stack != BUILTIN else f"--stack {BUILTIN}"
        raise InputError(f"log '{log.path}': {what}, expected one of a stack on trial")
    first = segments_of(log)[0]
    session = connect(stack, log.config.plugins.wall_s)
    try:
        start_session(session, task_of(first.config, first.mission, sensors_of(log)))
        yield RestartedStack(str(log.path), stack, session)
    finally:
        session.close()


def compare_answers(path: Path, stack: str) -> RestartedStack:
    """Query a stack on the inputs of each decision of a log, with the recorded answers before it.

    Args:
        path: The log of a stack on trial.
        stack: As `--stack` takes it; it is run.

    Raises:
        InputError: The log's stack was not on trial, or the stack cannot be restarted.
    """
    log = open_log(path, allow_plugins=True)
    if log.forks:
        raise InputError(f"log '{path}': a forked log, expected one of a stack on trial")
    with restarted_stack(log, stack) as restarted:
        navigator = TrialNavigator(log.config, log.mission, log.beams, restarted.session)
        for record in log.records():
            restarted.query(navigator, record)
            recompute(navigator, record)
    return restarted


def sensors_of(log: Log) -> dict[str, pb.SensorInfo]:
    """Return the sensors of a log by name; they stand before everything else in it."""
    infos: dict[str, pb.SensorInfo] = {}
    for message in read_messages(log.path):
        if not isinstance(message, pb.SensorInfo):
            break
        infos.setdefault(message.name, message)
    return infos
