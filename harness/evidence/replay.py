"""Recomputing every decision of a log from the log alone, and comparing bit by bit."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from harness.errors import InputError
from harness.evidence.relay import Relay, stretches
from harness.logs.reader import Log, Record, open_log
from harness.schema import wayproof_pb2 as pb
from harness.stack.decision import Difference, differences


@dataclass(frozen=True)
class Replay:
    """How a replay compares with its recording.

    Attributes:
        log: The log's path.
        identical: Every decision and the chain are the same bits.
        decisions: Decisions in the log.
        differing: Decisions that differ.
        first_difference: Sequence number of the first of them; none if identical.
        differences: What differs there, value by value.
        chain: Hash over the recomputed decisions.
        outcome: What the log says of the episode.
        wall_time_s: Time that the replay took.
    """

    log: str
    identical: bool
    decisions: int
    differing: int
    first_difference: int | None
    differences: tuple[Difference, ...]
    chain: str
    outcome: str
    wall_time_s: float


def replay(path: Path, allow_plugins: bool = False, threads: int | None = None) -> Replay:
    """Recompute a log's decisions.

    Args:
        path: The log.
        allow_plugins: Whether code that its config names may be imported.
        threads: In place of the log's own; no decision depends on them.

    Raises:
        InputError: The file is no finished log, holds no decision, or its sweeps were left out.
    """
    log = open_log(path, allow_plugins)
    if threads is not None:
        log = log.on_threads(threads)
    began = time.perf_counter()
    first: tuple[int, list[Difference]] | None = None
    decisions = differing = 0
    chain = ""
    for record, recomputed in recomputations(log):
        found = differences(record.decision, recomputed)
        if found:
            differing += 1
            first = first or (record.decision.sequence, found)
        decisions += 1
        chain = recomputed.chain
    if decisions == 0:
        raise InputError(f"log '{path}': no decisions in it")
    return Replay(
        log=str(path),
        identical=not differing and chain == log.result["chain"],
        decisions=decisions,
        differing=differing,
        first_difference=None if first is None else first[0],
        differences=() if first is None else tuple(first[1]),
        chain=chain,
        outcome=log.result["outcome"],
        wall_time_s=time.perf_counter() - began,
    )


def recomputations(log: Log) -> Iterator[tuple[Record, pb.Decision]]:
    """Each record with what is decided on it now; a forked log changes its settings on the way.

    Raises:
        InputError: The log is damaged, or cannot be recomputed.
    """
    relay = Relay(stretches(log))
    for record in log.records():
        yield record, relay.step(record)
