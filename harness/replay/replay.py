"""Replay: all that follows from the inputs of a log, computed again and compared bit by bit."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log, Record, open_log
from wayproof.harness.recompute.segments import SegmentedStack, segments_of
from wayproof.harness.replay.consistency import contradictions
from wayproof.harness.replay.scope import Scope, scope_of
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.decision import Difference, differences


@dataclass(frozen=True)
class Replay:
    """Comparison of a replay with its recording.

    Attributes:
        log: The log's path.
        identical: Whether every decision and the chain are equal bit by bit, and all else that
            follows from the content of the log agrees with it.
        decisions: Number of decisions in the log.
        differing: Number of decisions that differ.
        first_difference: Number of the first that differs; None if identical.
        differences: Differences in it, value by value.
        contradictions: Other content that does not follow from the rest: result, times, cause,
            hashes.
        chain: Hash over the recomputed decisions.
        outcome: Recorded outcome.
        scope: Parts that were recomputed, that need a new simulation, and that are claims.
        not_compared: Fields of decisions whose meaning differs in the older format of the log.
        wall_time_s: Wall time of the replay, s.
    """

    log: str
    identical: bool
    decisions: int
    differing: int
    first_difference: int | None
    differences: tuple[Difference, ...]
    contradictions: tuple[Difference, ...]
    chain: str
    outcome: str
    scope: Scope
    not_compared: tuple[str, ...]
    wall_time_s: float


def replay(
    path: Path, allow_plugins: bool = False, threads: int | None = None, with_cause: bool = True
) -> Replay:
    """Recompute the decisions of a log, and all else that follows from its content.

    Args:
        path: The log.
        allow_plugins: Whether code that its config names may be imported.
        threads: Number of threads, on which no decision depends; by default that of the log.
        with_cause: Whether to attribute the cause of a failure again, too.

    Raises:
        InputError: The file is no finished log, or has no decisions or no sweeps.
    """
    log = open_log(path, allow_plugins)
    if threads is not None:
        log = log.on_threads(threads)
    began = time.perf_counter()
    first: tuple[int, list[Difference]] | None = None
    decisions = differing = 0
    chain = ""
    for record, recomputed in recomputations(log):
        found = differences(record.decision, recomputed, log.not_compared)
        if found:
            differing += 1
            first = first or (record.decision.sequence, found)
        decisions += 1
        chain = recomputed.chain
    if decisions == 0:
        raise InputError(f"log '{path}': no decisions in it")
    others = contradictions(log)
    cause = None if others or differing or not with_cause else cause_differences(log)
    others += cause or []
    return Replay(
        log=str(path),
        identical=not differing
        and (bool(log.not_compared) or chain == log.result["chain"])
        and not others,
        decisions=decisions,
        differing=differing,
        first_difference=None if first is None else first[0],
        differences=() if first is None else tuple(first[1]),
        contradictions=tuple(others),
        chain=chain,
        outcome=log.result["outcome"],
        scope=scope_of(log, with_cause=cause is not None),
        not_compared=log.not_compared,
        wall_time_s=time.perf_counter() - began,
    )


def recomputations(log: Log) -> Iterator[tuple[Record, pb.Decision]]:
    """Yield each record with the recomputed decision, each segment with its own settings.

    Raises:
        InputError: The log is damaged, or cannot be recomputed.
    """
    stack = SegmentedStack(segments_of(log))
    for record in log.records():
        yield record, stack.step(record)


def cause_differences(log: Log) -> list[Difference] | None:
    """Return differences between the recorded cause of a failure and the one attributed now.

    Returns:
        Differences, empty if the cause is the same; None if the log has no cause, or MuJoCo, which
        measures the true geometry, is not installed.

    Raises:
        InputError: The log's scene cannot be compiled.
    """
    if not log.result.get("cause") or log.record == "decisions" or log.result["outcome"] == "error":
        return None
    try:
        from wayproof.harness.attribution import find_cause, read_case
    except ImportError:
        return None
    finding = find_cause(read_case(log))
    now = ("none", "", "-1")
    if finding is not None:
        now = (finding.cause, finding.evidence, str(finding.decision))
    names = ("cause", "cause_evidence", "cause_decision")
    return [
        Difference(f"result.{name}", log.result.get(name, "not recorded"), one)
        for name, one in zip(names, now, strict=True)
        if log.result.get(name) != one
    ]
