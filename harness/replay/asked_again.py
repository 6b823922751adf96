"""A stack asked again on a log's inputs: the first answer that differs from the recorded one."""

from __future__ import annotations

import itertools
import time
from dataclasses import dataclass
from pathlib import Path

from wayproof.harness.config import BUILTIN
from wayproof.harness.errors import InputError
from wayproof.harness.interface.connect import connect
from wayproof.harness.interface.observations import task_of
from wayproof.harness.interface.trial import TrialNavigator
from wayproof.harness.log.codec.messages import read_messages
from wayproof.harness.log.reader import open_log
from wayproof.harness.recompute.side_by_side import recompute
from wayproof.harness.schema import stack_pb2 as sb
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.decision import Difference, message_differences


@dataclass(frozen=True)
class AskedAgain:
    """How the answers of a stack compare with the recorded ones.

    Attributes:
        log: The log's path.
        stack: Name of the stack asked.
        identical: Whether every answer is the recorded one, bit by bit.
        answers: Answers in the log.
        differing: Answers that differ.
        first_difference: Number of the first of them; none if identical.
        differences: What differs there, value by value.
        wall_time_s: Time that it took.
    """

    log: str
    stack: str
    identical: bool
    answers: int
    differing: int
    first_difference: int | None
    differences: tuple[Difference, ...]
    wall_time_s: float


def ask_again(path: Path, stack: str) -> AskedAgain:
    """Ask a stack on the inputs of each decision of a log, with the recorded answers before it.

    Args:
        path: The log of a stack on trial.
        stack: As `--stack` takes it; it is run.

    Raises:
        InputError: The log's stack was not on trial, or the stack cannot be asked.
    """
    log = open_log(path, allow_plugins=True)
    if log.config.stack.name == BUILTIN or log.forks:
        what = "a forked log" if log.forks else "a log of the built-in stack"
        raise InputError(f"log '{path}': {what}, expected one of a stack on trial")
    began = time.perf_counter()
    first: tuple[int, list[Difference]] | None = None
    answers = differing = 0
    session = connect(stack, log.config.plugins.wall_s)
    try:
        navigator = TrialNavigator(log.config, log.mission, log.beams, session)
        session.start(task_of(log.config, log.mission, _infos(path)))
        for record in log.records():
            if record.answer is None:
                raise InputError(f"log '{path}': decision {answers} without an answer")
            asked = navigator.ask(record.inputs)
            recorded = sb.Command.FromString(record.answer.command)
            found = message_differences(recorded, sb.Command.FromString(asked.command))
            if found:
                differing += 1
                first = first or (record.decision.sequence, found)
            recompute(navigator, record)
            answers += 1
    finally:
        session.close()
    return AskedAgain(
        log=str(path),
        stack=stack,
        identical=not differing,
        answers=answers,
        differing=differing,
        first_difference=None if first is None else first[0],
        differences=() if first is None else tuple(first[1]),
        wall_time_s=time.perf_counter() - began,
    )


def _infos(path: Path) -> dict[str, pb.SensorInfo]:
    """The sensors of a log, which stand before everything else in it."""
    messages = itertools.takewhile(
        lambda message: isinstance(message, pb.SensorInfo), read_messages(path)
    )
    return {message.name: message for message in messages if isinstance(message, pb.SensorInfo)}
