"""The counterfactual check: one thing put right; does the failure go away?

A control goes on with nothing changed and has to fail again, or else the check says nothing. Then
one thing at a time is put right. What ended in a contact or a fall goes on from a second before its
last chance, and only where nothing saves it there, from the start; what ran out of time or got
stuck is run again from the start. Where the check was run, its answer decides the cause.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from wayproof.harness.attribution.case import Case, read_case
from wayproof.harness.attribution.finding import CAUSES, Finding
from wayproof.harness.attribution.standstill import lacks_time
from wayproof.harness.config import BUILTIN
from wayproof.harness.counterfactual.remedies import REMEDIES, go_on, nothing
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log

MORE_TIME = 5.0
"""How long an episode may go on after the contact that it ended with, s."""

BEFORE = 1.0
"""Before a contact things are put right so long before the last chance, s: it takes a moment."""

CONTROL = "control"

HARM = ("collision", "fall", "out_of_bounds", "error")

SHOWN_BY_THEIR_OWN_TEST = ("impossible", "planner", "tracking")
"""Causes that facts show and that no remedy has to take away: what is missing may not be there to
be put right."""

HELPS_ALWAYS = "true_map"
"""Who knows all that stands about, as no sensor tells it, may do without much else."""

ONLY_AFTER = {"more_time": ("timeout",)}
"""Remedies that make no difference after other outcomes."""

ONLY_SHOWN = ("more_time",)
"""Remedies that bear out a cause only where its own test holds: with time enough, even a poor
planner arrives."""

LACKING = {True: "no_margin", False: "more_time"}
"""Of what is impossible for want of time, or else of space: the remedy that says nothing of it."""


@dataclass(frozen=True)
class Check:
    """What one change would have done.

    Attributes:
        remedy: Which, one of `REMEDIES`, or the control.
        begin: Number of the first decision with it.
        outcome: Of the episode with it.
        end_s: When that ended, in simulated time.
        saves: Whether the robot came to the goal; or, where it had touched something or fallen, to
            no harm.
    """

    remedy: str
    begin: int
    outcome: str
    end_s: float
    saves: bool


@dataclass(frozen=True)
class Verdict:
    """The cause of a failure after its check.

    Attributes:
        finding: What the check leaves of the cause.
        answer: `confirmed`, `changed` or `inconclusive`.
        checks: All that was tried.
        simulated_s: Simulated time that it took, s.
    """

    finding: Finding
    answer: str
    checks: tuple[Check, ...]
    simulated_s: float


def check(
    log: Log,
    finding: Finding,
    remedies: Sequence[str] = (),
    thorough: bool = True,
    most_s: float = float("inf"),
) -> Verdict:
    """Try remedies for a failure, and settle its cause.

    Args:
        log: Of the failure.
        finding: Its cause by the tests of facts.
        remedies: Of `REMEDIES`; all if none are named.
        thorough: Try all of them; otherwise no more once one bears the cause out.
        most_s: No other remedy is begun after so much simulated time.

    Raises:
        InputError: The log keeps no state there, or does not replay.
    """
    if log.config.stack.name != BUILTIN:
        raise InputError(
            f"log '{log.path}': stack '{log.config.stack.name}' was on trial, and remedies change "
            "the built-in stack; expected a log of that one. --guard shows what the referee would "
            "have stopped"
        )
    case = read_case(log)
    names = list(remedies) or _in_order(case, finding.cause)
    beside = LACKING[lacks_time(case)] if finding.cause == "impossible" else ""
    names = [name for name in names if name != beside]
    checks: list[Check] = []
    simulated = 0.0
    for begin in _begins(case, finding):
        for name in (CONTROL, *names):
            if simulated >= most_s:
                break
            one, took = _try(log, case, finding, name, begin)
            checks.append(one)
            simulated += took
            if name == CONTROL and one.saves:
                break
            if not thorough and one.saves and finding.cause in REMEDIES[name][1]:
                break
        if any(one.saves for one in checks) or simulated >= most_s:
            break
    if simulated >= most_s and not any(one.saves for one in checks):  # the rest may save it
        return Verdict(finding, "inconclusive", tuple(checks), simulated)
    settled, answer = settle(finding, checks)
    return Verdict(settled, answer, tuple(checks), simulated)


def settle(finding: Finding, checks: Sequence[Check]) -> tuple[Finding, str]:
    """The cause that the answers of a check leave, and what they did to the one that was found.

    If a remedy of the cause saves the robot, it is confirmed. If only others do, the first of
    their causes in the order of `CAUSES` takes its place, a true map's if nothing else saves it.
    If nothing saves it, only a cause that its own test shows stands; any other is unexplained.
    """
    if any(one.remedy == CONTROL and one.saves for one in checks):
        return finding, "inconclusive"
    tried = [one for one in checks if one.remedy != CONTROL]
    if not tried:
        return finding, "inconclusive"
    saving = [one.remedy for one in tried if one.saves and _bears_out(one.remedy, finding.cause)]
    borne_out = [cause for name in saving for cause in REMEDIES[name][1]]
    if finding.cause in borne_out:
        return finding, "confirmed"
    if saving:
        saving = [name for name in saving if name != HELPS_ALWAYS] or saving
        cause, by = min(
            ((_led_to(name, checks), name) for name in saving), key=lambda one: CAUSES.index(one[0])
        )
        evidence = f"{by.replace('_', ' ')} alone saves the robot"
    elif finding.cause in (*SHOWN_BY_THEIR_OWN_TEST, "unexplained"):
        return finding, "confirmed"
    else:
        cause, evidence = "unexplained", "no remedy saves the robot"
    before = f"{evidence}; the facts alone gave {finding.cause}: {finding.evidence}"
    return Finding(cause, before, finding.decision, finding.place), "changed"


def _in_order(case: Case, cause: str) -> list[str]:
    """Remedies that can bear something out, those of a cause first and a true map last."""
    names = [name for name in REMEDIES if case.outcome in ONLY_AFTER.get(name, (case.outcome,))]
    names = [name for name in names if _bears_out(name, cause) and _differs(name, case)]
    return sorted(names, key=lambda name: (cause not in REMEDIES[name][1], name == HELPS_ALWAYS))


def _differs(remedy: str, case: Case) -> bool:
    """Whether there is anything for a remedy to put right."""
    if remedy == "no_movers":
        return any(moment.truth.movers for moment in case.moments[:1])
    return remedy != "forbidden_unknown" or case.config.costmap.unknown_policy != "forbid"


def _led_to(remedy: str, checks: Sequence[Check]) -> str:
    """The cause that a remedy points to where the facts gave another one."""
    if remedy != HELPS_ALWAYS:
        return REMEDIES[remedy][1][0]
    touched = any(one.remedy == CONTROL and one.outcome == "collision" for one in checks)
    return "missed_obstacle" if touched else "ghost_obstacle"


def _bears_out(remedy: str, cause: str) -> bool:
    """Whether a remedy that saves the robot says anything where the facts gave this cause."""
    return remedy not in ONLY_SHOWN or cause in REMEDIES[remedy][1]


def _begins(case: Case, finding: Finding) -> Iterator[int]:
    """Decisions from which on things are put right, one after the other until something saves."""
    if case.outcome in ("collision", "fall", "out_of_bounds"):
        before_ns = case.moments[finding.decision].time_ns - round(BEFORE * 1e9)
        at = sum(moment.time_ns < before_ns for moment in case.moments)
        if at > 0:
            yield at
    yield 0


def _try(log: Log, case: Case, finding: Finding, name: str, begin: int) -> tuple[Check, float]:
    """One remedy from a decision on, or from the start for those that need it; simulated s."""
    touched = case.outcome in ("collision", "fall", "out_of_bounds")
    if name in FROM_THE_START:
        begin = 0
    log, case_then = log.as_of(begin), case.as_of(begin)
    make = nothing if name == CONTROL else REMEDIES[name][0]
    limit_s = case.end_s + MORE_TIME if touched else log.config.episode.time_limit
    result = go_on(log, case_then, make(log, case_then), begin, limit_s)
    saves = result.outcome == "success" or (touched and result.outcome not in HARM)
    took = result.sim_time_s - case.moments[begin].time_ns * 1e-9
    return Check(name, begin, result.outcome, result.sim_time_s, saves), took


FROM_THE_START = ("true_pose", "true_ranges")
"""What lied had lied before, and the map and the body's way follow from it."""


def checkable(log: Log) -> bool:
    """Whether a log holds what a check needs: a failure, its sweeps and its states."""
    return log.result["outcome"] not in ("success", "error") and log.record != "decisions"


def refuse_success(log: Log) -> None:
    """Refuse a log that there is nothing to check in.

    Raises:
        InputError: It is one of a success.
    """
    if not checkable(log):
        raise InputError(
            f"log '{log.path}': {log.result['outcome']}, expected a failure, recorded in full"
        )
