"""Recomputing every decision of a log from the log alone, and comparing bit by bit."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from harness.decision import differences
from harness.errors import InputError
from harness.navigator import build_navigator
from harness.reader import open_log


@dataclass(frozen=True)
class Replay:
    """How a replay compares with its recording.

    Attributes:
        log: The log's path.
        identical: Every decision and the chain are the same bits.
        decisions: Decisions in the log.
        differing: Decisions that differ.
        first_difference: Sequence number of the first of them; none if identical.
        fields: Names of the fields that differ there.
        chain: Hash over the recomputed decisions.
        outcome: What the log says of the episode.
        wall_time_s: Time that the replay took.
    """

    log: str
    identical: bool
    decisions: int
    differing: int
    first_difference: int | None
    fields: tuple[str, ...]
    chain: str
    outcome: str
    wall_time_s: float


def replay(path: Path, allow_plugins: bool = False) -> Replay:
    """Recompute a log's decisions.

    Args:
        path: The log.
        allow_plugins: Whether code that its config names may be imported.

    Raises:
        InputError: The file is no finished log, or holds no decision.
    """
    log = open_log(path, allow_plugins)
    began = time.perf_counter()
    navigator = build_navigator(log.config, log.mission, log.beams)
    differing: list[tuple[int, list[str]]] = []
    decisions = 0
    for record in log.records():
        recomputed = navigator.commit(navigator.step(record.inputs), record.latency.delay_s)
        names = differences(record.decision, recomputed)
        if names:
            differing.append((record.decision.sequence, names))
        decisions += 1
    if decisions == 0:
        raise InputError(f"log '{path}': no decisions in it")
    first = differing[0] if differing else (None, [])
    return Replay(
        log=str(path),
        identical=not differing and navigator.chain == log.result["chain"],
        decisions=decisions,
        differing=len(differing),
        first_difference=first[0],
        fields=tuple(first[1]),
        chain=navigator.chain,
        outcome=log.result["outcome"],
        wall_time_s=time.perf_counter() - began,
    )
