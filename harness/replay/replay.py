"""Replay: all that follows from the inputs of a log, computed again and compared bit by bit."""

from __future__ import annotations

import functools
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from wayproof.harness.config import BUILTIN, HASH_SEPARATOR
from wayproof.harness.decision import Difference, differences
from wayproof.harness.ending import BETWEEN_DECISIONS
from wayproof.harness.errors import InputError
from wayproof.harness.forked import ForkFailed, beside
from wayproof.harness.log.machine import Program, other_program
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.recompute.keyframes import WHOLE, Piece, pieces_of, stack_at, startable
from wayproof.harness.recompute.moments import Observer, SegmentedStack, moments, segments_of
from wayproof.harness.replay.consistency import contradictions
from wayproof.harness.result import ends_in_error, is_recovered
from wayproof.harness.schema import wayproof_pb2 as pb
from wayproof.harness.stack.keyframe import has_keyframes, keyframe_differences


@dataclass(frozen=True)
class Recomputed:
    """Decisions recomputed and compared.

    Attributes:
        decisions: Their number.
        differing: Number of those that differ.
        first_difference: Number of the first of these; None without any.
        differences: Differences in it, value by value.
        keyframe_differences: Differences of the keyframes, of each the first.
        chain: Chain after the last decision.
    """

    decisions: int = 0
    differing: int = 0
    first_difference: int | None = None
    differences: tuple[Difference, ...] = ()
    keyframe_differences: tuple[Difference, ...] = ()
    chain: str = ""

    def then(self, later: Recomputed) -> Recomputed:
        """Return this and the decisions after it as one."""
        own = self.first_difference is not None
        return Recomputed(
            decisions=self.decisions + later.decisions,
            differing=self.differing + later.differing,
            first_difference=self.first_difference if own else later.first_difference,
            differences=self.differences if own else later.differences,
            keyframe_differences=(*self.keyframe_differences, *later.keyframe_differences),
            chain=later.chain,
        )


@dataclass(frozen=True, kw_only=True)
class Replay(Recomputed):
    """Comparison of a replay with its recording.

    Attributes:
        log: The log's path.
        identical: Whether every decision and the chain are equal bit by bit, and all else that
            follows from the content of the log agrees with it.
        contradictions: Other content that does not follow from the rest: result, times, cause,
            hashes, keyframes.
        outcome: Recorded outcome.
        scope: Parts that were recomputed, that need a new simulation, and that are claims.
        program: Program that recorded the log, if it is not this one.
        wall_time_s: Wall time of the replay, s.
    """

    log: str
    identical: bool
    contradictions: tuple[Difference, ...]
    outcome: str
    scope: Scope
    program: Program | None
    wall_time_s: float


def replay(
    path: Path,
    allow_plugins: bool = False,
    with_cause: bool = True,
    jobs: int = 1,
) -> Replay:
    """Recompute the decisions of a log, and all else that follows from its content.

    With several processes each starts at a keyframe of the log, and every keyframe is computed
    again by the process that arrives at it. If one differs, all is recomputed from the start.

    Args:
        path: The log.
        allow_plugins: Whether code that its config names may be imported.
        with_cause: Whether to attribute the cause of a failure again, too.
        jobs: Maximum number of processes.

    Raises:
        InputError: The file is no finished log, or has no decisions or no sweeps.
    """
    log = open_log(path, allow_plugins)
    began = time.perf_counter()
    recomputed, others = _recomputed(log, jobs)
    if recomputed.decisions == 0:
        raise InputError(f"log '{path}': no decisions in it")
    others += recomputed.keyframe_differences
    differing = recomputed.differing
    cause = None if others or differing or not with_cause else cause_differences(log)
    others += cause or []
    return Replay(
        **vars(recomputed),
        log=str(path),
        identical=not differing and recomputed.chain == log.result["chain"] and not others,
        contradictions=tuple(others),
        outcome=log.result["outcome"],
        scope=scope_of(log, with_cause=cause is not None),
        program=other_program(log.run),
        wall_time_s=time.perf_counter() - began,
    )


def _recomputed(log: Log, jobs: int) -> tuple[Recomputed, list[Difference]]:
    """Recompute all decisions; return them, and other contradictions in the log."""
    log.check_sweeps()
    keyframes = log.keyframes()
    pieces = [WHOLE]
    if jobs > 1 and keyframes:
        count = log.result.get("decisions", "")
        decisions = int(count) if count.isdecimal() and len(count) < 9 else 0
        pieces = pieces_of(startable(log, keyframes), decisions, jobs)
    if len(pieces) > 1:
        later = [partial(recompute_piece, log, keyframes, one) for one in pieces[1:]]
        try:
            (others, first), rest = beside(
                later, lambda: (contradictions(log), recompute_piece(log, keyframes, pieces[0]))
            )
        except (ForkFailed, InputError):  # a broken keyframe, or a log that no piece can read
            pass
        else:
            whole = functools.reduce(Recomputed.then, rest, first)
            if not whole.keyframe_differences:
                return whole, others
    return recompute_piece(log, keyframes), contradictions(log)


def recompute_piece(
    log: Log,
    keyframes: Sequence[pb.Keyframe],
    piece: Piece = WHOLE,
    observe: Observer | None = None,
) -> Recomputed:
    """Recompute the decisions of one piece, and compare them and the keyframes after them.

    Args:
        log: The log.
        keyframes: All of it.
        piece: The piece.
        observe: Called with each decision after it was made again.

    Raises:
        InputError: The log is damaged, or cannot be recomputed, or a keyframe that the piece starts
            from holds no state of such a stack.
    """
    start = piece.keyframe
    if start is None:
        stack = SegmentedStack(segments_of(log))
    else:
        stack = stack_at(log, startable(log, keyframes), start)
    first: tuple[int, list[Difference]] | None = None
    decisions = differing = 0
    held = {one.sequence: one for one in keyframes if piece.holds(one.sequence)}
    others: list[Difference] = []
    for moment in moments(log, decide=True, stack=stack, after=start):
        recomputed = moment.recomputed
        assert recomputed is not None
        found = differences(moment.decision, recomputed)
        if found:
            differing += 1
            first = first or (moment.decision.sequence, found)
        if observe is not None:
            observe(moment)
        decisions += 1
        if keyframe := held.pop(recomputed.sequence, None):
            others += _keyframe_difference(keyframe, stack, recomputed)
        if recomputed.sequence + 1 == piece.end:
            break
    others += [Difference(_place(number), "a state", "no such decision") for number in held]
    return Recomputed(
        decisions=decisions,
        differing=differing,
        first_difference=None if first is None else first[0],
        differences=() if first is None else tuple(first[1]),
        keyframe_differences=tuple(others),
        chain=stack.navigator.chain,
    )


def _place(sequence: int) -> str:
    return f"/keyframe[{sequence}]"


def _keyframe_difference(
    keyframe: pb.Keyframe, stack: SegmentedStack, decision: pb.Decision
) -> list[Difference]:
    """Return the first difference of a keyframe from the stack after its decision."""
    place = _place(decision.sequence)
    if not has_keyframes(stack.segment.config):
        return [Difference(place, "a state", "none with these settings")]
    found = keyframe_differences(keyframe, stack.navigator, decision)
    return [replace(one, field=f"{place}.{one.field}") for one in found[:1]]


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


MADE_AGAIN = {
    (False, False): ("scene, mission and config from the seed",),
    (False, True): ("world from the seed",),
    (True, False): ("model of the robot",),
    (True, True): (),
}
"""Parts that a new simulation makes, by whether the world and the robot are files."""


@dataclass(frozen=True)
class Scope:
    """Parts of a log by how they can be checked.

    Attributes:
        recomputed: Parts that follow from the rest of the log.
        simulation: Parts that only a new simulation can check.
        claims: Parts that nobody can recompute; only a signature protects them.
    """

    recomputed: tuple[str, ...]
    simulation: tuple[str, ...]
    claims: tuple[str, ...]


def scope_of(log: Log, with_cause: bool) -> Scope:
    """Sort the parts of a log by how they can be checked.

    Args:
        log: The log.
        with_cause: Whether the cause was recomputed.
    """
    if log.config.recording is not None:
        return _scope_of_recording(log)
    result = [
        "number and times of decisions",
        "least clearance",
        "path length",
        "deadline misses",
        "commands admitted",
    ]
    physics = ["truth", "contact"] if log.result.get("contact") else ["truth"]
    if not ends_in_error(log.result):
        between = log.result["outcome"] in BETWEEN_DECISIONS
        (physics if between else result).extend(["outcome", "reason", "goal distance"])
    if log.result.get("cause"):
        (result if with_cause else physics).append("cause")
    inputs = ["poses", "streams world and control"]
    files = HASH_SEPARATOR in log.config.world, HASH_SEPARATOR in log.config.robot
    inputs.extend(MADE_AGAIN[files])
    perturbed = any(run.config.perturbation for run in segments_of(log))
    if perturbed:
        result.append("perturbation's kind, amount and delay")
        inputs.append("perturbation's effect")
    if log.record == "decisions":
        return Scope(
            recomputed=("chain where global paths are kept", *result),
            simulation=("decisions", "rest of the chain", *inputs, *physics),
            claims=_claims(log),
        )
    keyframes = ("keyframes",) if has_keyframes(log.config) else ()
    return Scope(
        recomputed=(
            "decisions",
            *keyframes,
            "chain",
            "input digests",
            "streams of inputs",
            *result,
        ),
        simulation=("sweeps", "states", *inputs, *physics),
        claims=_claims(log),
    )


def _scope_of_recording(log: Log) -> Scope:
    """Sort the parts of a recording's log: its inputs are claims without a simulation."""
    inputs = ("decisions", "chain", "input digests", "streams of inputs")
    figures = ("number and times of decisions", "way driven", "deadline misses")
    perturbed = ("perturbation's kind, amount and delay",) if log.config.perturbation else ()
    recorded = ("sweeps", "poses", "goals", "recorded way", "faults of the recording")
    return Scope((*inputs, *figures, *perturbed), (), (*recorded, *_claims(log)))


def _claims(log: Log) -> tuple[str, ...]:
    claims = ["stage latencies", "versions", "machine"]
    runs = segments_of(log)
    if any(run.config.latency.mode == "measured" for run in runs):
        claims.append("measured delays")
    for name, value in (("world", log.config.world), ("robot", log.config.robot)):
        if HASH_SEPARATOR in value:
            claims.append(f"{name} file {value}")
    if is_recovered(log.result):
        claims.append("that its end is missing")
    elif ends_in_error(log.result):
        claims.append("the error that ended it")
    if log.config.stack.name != BUILTIN:
        claims.append(f"answers of a stack named '{log.config.stack.name}'")
    if log.asked and any(HASH_SEPARATOR in name for name in (log.config.world, log.config.robot)):
        claims.append("settings as they were asked for")
    if log.check:
        claims.append("verdict of its counterfactual check")
    if log.plugins:
        claims.append("files of the user's classes")
    return tuple(claims)
