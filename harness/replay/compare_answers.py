"""A comparison of a stack's answers to a log's inputs with the recorded ones."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from wayproof.harness.decision import Difference
from wayproof.harness.errors import InputError
from wayproof.harness.interface.trial import TrialNavigator
from wayproof.harness.log.reader import open_log
from wayproof.harness.recompute.side_by_side import recompute
from wayproof.harness.replay.answers import RestartedStack, restarted_stack


@dataclass(frozen=True)
class Comparison:
    """Comparison of the answers of a stack with the recorded ones.

    Attributes:
        log: The log's path.
        stack: Name of the stack.
        identical: Whether every answer is the recorded one, bit by bit.
        answers: Answers compared.
        differing: Answers that differ.
        first_difference: Number of the first of them; none if identical.
        differences: Differences there, value by value.
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


def compare_answers(path: Path, stack: str) -> Comparison:
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
    began = time.perf_counter()
    with restarted_stack(log, stack) as restarted:
        navigator = TrialNavigator(log.config, log.mission, log.beams, restarted.session)
        for record in log.records():
            restarted.query(navigator, record)
            recompute(navigator, record)
    return comparison(restarted, time.perf_counter() - began)


def comparison(restarted: RestartedStack, wall_time_s: float) -> Comparison:
    """Return the comparison of the answers of a restarted stack."""
    return Comparison(
        log=restarted.log,
        stack=restarted.stack,
        identical=not restarted.differing,
        answers=restarted.answers,
        differing=restarted.differing,
        first_difference=restarted.first_difference,
        differences=tuple(restarted.differences),
        wall_time_s=wall_time_s,
    )
