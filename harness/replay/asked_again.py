"""A stack asked again on a log's inputs: the first answer that differs from the recorded one."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from wayproof.harness.errors import InputError
from wayproof.harness.interface.trial import TrialNavigator
from wayproof.harness.log.reader import open_log
from wayproof.harness.recompute.side_by_side import recompute
from wayproof.harness.replay.answers import AskedAgain, started_again
from wayproof.harness.stack.decision import Difference


@dataclass(frozen=True)
class Comparison:
    """How the answers of a stack compare with the recorded ones.

    Attributes:
        log: The log's path.
        stack: Name of the stack asked.
        identical: Whether every answer is the recorded one, bit by bit.
        answers: Answers compared.
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


def ask_again(path: Path, stack: str) -> Comparison:
    """Ask a stack on the inputs of each decision of a log, with the recorded answers before it.

    Args:
        path: The log of a stack on trial.
        stack: As `--stack` takes it; it is run.

    Raises:
        InputError: The log's stack was not on trial, or the stack cannot be asked.
    """
    log = open_log(path, allow_plugins=True)
    if log.forks:
        raise InputError(f"log '{path}': a forked log, expected one of a stack on trial")
    began = time.perf_counter()
    with started_again(log, stack) as asked:
        navigator = TrialNavigator(log.config, log.mission, log.beams, asked.session)
        for record in log.records():
            asked.ask(navigator, record)
            recompute(navigator, record)
    return comparison(asked, time.perf_counter() - began)


def comparison(asked: AskedAgain, wall_time_s: float) -> Comparison:
    """Return how the answers of a stack that was asked again compare."""
    return Comparison(
        log=asked.log,
        stack=asked.stack,
        identical=not asked.differing,
        answers=asked.answers,
        differing=asked.differing,
        first_difference=asked.first_difference,
        differences=tuple(asked.differences),
        wall_time_s=wall_time_s,
    )
