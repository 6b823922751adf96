"""Counterfactual check of a cause: does the failure go away with one thing put right?

A control without a change must fail again, or the check is inconclusive. Then one remedy at a time
is tried. A contact or a fall is simulated from one second before its last chance, and if nothing
helps there, from the start; an episode that ran out of time or got stuck is simulated from the
start. The answer of the check decides the cause: it names another one only where the remedy of that
saves the robot on a second seed of the noise too, or where its own test was near to holding.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

from wayproof.harness.attribution import contact, standstill
from wayproof.harness.attribution.case import Case, read_case
from wayproof.harness.attribution.finding import CAUSES, Finding
from wayproof.harness.attribution.procedure import near_causes
from wayproof.harness.attribution.standstill import lacks_time
from wayproof.harness.config import BUILTIN
from wayproof.harness.counterfactual.guard import check_by_guard
from wayproof.harness.counterfactual.remedies import (
    ON_TRIAL,
    REMEDIES,
    admits_by_prior,
    go_on,
    nothing,
)
from wayproof.harness.counterfactual.verdict import (
    CONTROL,
    HARM,
    MORE_TIME,
    TOUCHED,
    Check,
    Verdict,
)
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import Log
from wayproof.harness.perturbations.perturbation import LATE
from wayproof.harness.replay.answers import restarted_stack

BEFORE = 1.0
"""Time before the last chance at which a remedy begins, s: it needs time to take effect."""

SHOWN_BY_THEIR_OWN_TEST = ("impossible", "planner", "tracking", "stack_held", "exploration")
"""Causes that facts alone establish: what is missing may be impossible to put right."""

TRUE_MAP = "true_map"
"""Remedy that helps after nearly every fault of sensing: complete knowledge, as no sensor gives."""

SENSING = ("true_pose", "true_ranges")
"""Remedies of faults of sensing: where one of them saves the robot, a true map shows nothing."""

ONLY_CONFIRMS = ("guard", "no_guard", "no_margin")
"""Remedies that may save the robot from other causes as well, by stopping it or by daring more."""

ONLY_AFTER = {"more_time": ("timeout",)}
"""Remedies that only make a difference after these outcomes."""

ONLY_SHOWN = ("more_time",)
"""Remedies that confirm a cause only if its own test holds: given time, any planner arrives."""

LACKING = {True: "no_margin", False: "more_time"}
"""Remedy that does not apply to `impossible`, by whether time is lacking, or else space."""


def check(
    log: Log,
    finding: Finding,
    remedies: Sequence[str] = (),
    thorough: bool = True,
    most_s: float = float("inf"),
    stack: str = "",
) -> Verdict:
    """Try remedies for a failure, and settle its cause.

    Args:
        log: Log of the failure.
        finding: Its attributed cause.
        remedies: Names in `REMEDIES`; all by default.
        thorough: Whether to try all of them, or stop at the first that confirms the cause.
        most_s: Simulated time after which no other remedy is begun, s.
        stack: The stack that was on trial, as `--stack` takes it; it is run. Without it the guard
            alone is tried, with the recorded answers.

    Raises:
        InputError: The log has no state there, or does not replay; or no stack was on trial.
    """
    case = read_case(log)
    if log.config.stack.name != BUILTIN and not stack:
        return check_by_guard(log, case, finding)
    names = list(remedies) or _in_order(case, finding.cause)
    beside = LACKING[lacks_time(case)] if finding.cause == "impossible" else ""
    names = [name for name in names if name != beside]
    checks: list[Check] = []
    simulated, note, near = 0.0, "", frozenset[str]()
    for begin in _begins(case, finding):
        for name in (CONTROL, *names):
            if simulated >= most_s:
                break
            one, took, other = _try(log, case, finding, name, begin, stack)
            checks.append(one)
            note, simulated = note or other, simulated + took
            if name == CONTROL and (one.saves or one.outcome != case.outcome):
                break
            if not thorough and settle(finding, checks, case.outcome)[1] == "confirmed":
                break
        if any(one.saves for one in checks) or simulated >= most_s:
            break
    doubtful = _for_others(finding, checks, case.outcome)
    if doubtful and settle(finding, [*checks, *_again(doubtful)], case.outcome)[1] == "changed":
        near = near_causes(case)
        for one in doubtful:
            if _led_to(one.remedy, checks) not in near and simulated < most_s:
                again, took, _ = _try(log, case, finding, one.remedy, one.begin, stack, again=True)
                checks.append(again)
                simulated += took
    settled, answer = settle(finding, checks, case.outcome, near)
    if answer == "inconclusive":
        why = why_inconclusive(finding, checks, case.outcome)
        note = f"{why}; {note}" if note else why
    if simulated >= most_s and not any(one.saves for one in checks):  # the rest may save it
        spent = f"the bound of {most_s:g} s of simulated time left remedies untried"
        settled, answer, note = finding, "inconclusive", f"{spent}; {note}" if note else spent
    return Verdict(settled, answer, checks=tuple(checks), simulated_s=simulated, note=note)


def settle(
    finding: Finding, checks: Sequence[Check], recorded: str, near: Collection[str] = ()
) -> tuple[Finding, str]:
    """Return the cause that the checks leave, and the answer.

    A control that ends otherwise than recorded shows nothing. If a remedy of the cause saves the
    robot, the cause is confirmed; a true map confirms only where neither a true pose nor true
    ranges save it alone. Other remedies count if the test of what they stand for was near to
    holding, or if they save it on a second seed as well, and if that is asked for before the cause:
    what is asked later, the cause can bring about. If such a remedy saves the robot, its cause
    replaces the one by the facts, the first in the order of `CAUSES`. If none does, a cause that
    facts alone establish stands, and of any other nothing is shown.

    Args:
        finding: Cause by the facts.
        checks: Outcomes of the control and the remedies.
        recorded: Outcome of the episode.
        near: Causes whose own tests hold, or were near to holding.
    """
    tried = {one.remedy for one in checks if one.remedy != CONTROL}
    if not tried or _other_control(checks, recorded) is not None:
        return finding, "inconclusive"
    saving = {one.remedy for one in checks if one.saves and not one.again}
    again = {one.remedy for one in checks if one.saves and one.again}
    if any(finding.cause in REMEDIES[name][1] for name in saving - {TRUE_MAP}):
        return finding, "confirmed"
    others = [one.remedy for one in _for_others(finding, checks, recorded)]
    led = [(_led_to(name, checks), name) for name in others]
    upheld = [(cause, name) for cause, name in led if name in again or cause in near]
    if upheld:
        return _changed(finding, *min(upheld, key=lambda one: CAUSES.index(one[0])))
    if TRUE_MAP in saving and finding.cause in REMEDIES[TRUE_MAP][1]:
        return finding, "confirmed"
    if TRUE_MAP in saving and _led_to(TRUE_MAP, checks) in near:
        return _changed(finding, _led_to(TRUE_MAP, checks), TRUE_MAP)
    if finding.cause in (*SHOWN_BY_THEIR_OWN_TEST, "unexplained"):
        return finding, "confirmed"
    return finding, "inconclusive"


def _asked_before(cause: str, found: str, recorded: str) -> bool:
    """Return whether a cause is asked for before another one after an outcome.

    After a collision those of the commands of a stack on trial come first; they don't count.
    """
    tests = contact.TESTS if recorded == "collision" else standstill.TESTS

    def places(of: str) -> list[int]:
        return [k for k, (name, _) in enumerate(tests) if name == of] or [len(tests)]

    place = max(places(cause)) if recorded == "collision" else min(places(cause))
    return place < max(places(found))


def _changed(finding: Finding, cause: str, by: str) -> tuple[Finding, str]:
    evidence = (
        f"{by.replace('_', ' ')} alone saves the robot; the facts alone gave {finding.cause}: "
        f"{finding.evidence}"
    )
    return Finding(cause, evidence, finding.decision, finding.place), "changed"


def _for_others(finding: Finding, checks: Sequence[Check], recorded: str) -> list[Check]:
    """Return the checks that saved the robot and stand for a cause asked for before another."""
    beside = (CONTROL, TRUE_MAP, *ONLY_CONFIRMS, *ONLY_SHOWN)
    return [
        one
        for one in checks
        if one.saves
        and not one.again
        and one.remedy not in beside
        and _asked_before(_led_to(one.remedy, checks), finding.cause, recorded)
    ]


def _again(checks: Sequence[Check]) -> list[Check]:
    """Return checks as if each came out the same with another seed of the noise."""
    return [replace(one, again=True) for one in checks]


def why_inconclusive(finding: Finding, checks: Sequence[Check], recorded: str) -> str:
    """Return why checks show nothing of a cause, in words; arguments as of `settle`."""
    control = _other_control(checks, recorded)
    if control is not None:
        return f"without a change it ended as {control.outcome}, not as recorded"
    tried = [one for one in checks if one.remedy != CONTROL]
    if not tried:
        return "no remedy was tried"
    saving = [one.remedy.replace("_", " ") for one in tried if one.saves and not one.again]
    if saving:
        return f"{' and '.join(saving)} alone saves it, which says nothing about {finding.cause}"
    if any(finding.cause in REMEDIES[one.remedy][1] for one in tried):
        return f"no remedy for {finding.cause} saves it, and no other"
    return f"no remedy for {finding.cause} was tried, and no other saves it"


def _other_control(checks: Sequence[Check], recorded: str) -> Check | None:
    """Return the first control that did not end as recorded; None without one."""
    controls = [one for one in checks if one.remedy == CONTROL]
    return next((one for one in controls if one.saves or one.outcome != recorded), None)


def _in_order(case: Case, cause: str) -> list[str]:
    """Return the remedies that apply: those of a cause, those of sensing, a true map last.

    A true map comes before what stands for other causes, if it stands for this one.
    """
    names = [name for name in REMEDIES if case.outcome in ONLY_AFTER.get(name, (case.outcome,))]
    on_trial = case.config.stack.name != BUILTIN
    names = [name for name in names if not on_trial or name in ON_TRIAL]
    names = [name for name in names if name not in ONLY_SHOWN or cause in REMEDIES[name][1]]

    def place(name: str) -> int:
        own = cause in REMEDIES[name][1]
        if name == TRUE_MAP:
            return 2 if own else 4
        return 0 if own else 1 if name in SENSING else 3

    return sorted((name for name in names if _differs(name, case)), key=place)


def _differs(remedy: str, case: Case) -> bool:
    """Return whether a remedy changes anything in a case."""
    if remedy == "no_movers":
        return any(moment.truth.movers for moment in case.moments[:1])
    if remedy == "fresh_evidence":
        perturbation = case.config.perturbation
        return perturbation is not None and perturbation.changes in LATE
    if remedy in ("guard", "no_guard"):
        on_trial, guarded = case.config.stack.name != BUILTIN, case.config.stack.guard
        return on_trial and guarded == (remedy == "no_guard")
    if remedy == "forbidden_unknown":
        return case.config.costmap.unknown_policy != "forbid" or admits_by_prior(case.config)
    return True


def _led_to(remedy: str, checks: Sequence[Check]) -> str:
    """Return the cause that a remedy indicates."""
    if remedy != TRUE_MAP:
        return REMEDIES[remedy][1][0]
    touched = any(one.remedy == CONTROL and one.outcome == "collision" for one in checks)
    return "missed_obstacle" if touched else "ghost_obstacle"


def _begins(case: Case, finding: Finding) -> Iterator[int]:
    """Yield the decisions at which remedies begin, in turn until one saves the robot."""
    if case.outcome in TOUCHED:
        before_ns = case.moments[finding.decision].time_ns - round(BEFORE * 1e9)
        at = sum(moment.time_ns < before_ns for moment in case.moments)
        if at > 0:
            yield at
    yield 0


def _try(
    log: Log,
    case: Case,
    finding: Finding,
    name: str,
    begin: int,
    stack: str,
    again: bool = False,
) -> tuple[Check, float, str]:
    """Try one remedy from a decision on, or from the start; again with another seed of the noise.

    Returns:
        The outcome, the simulated time, s, and a note on the answers of the stack before.
    """
    touched = case.outcome in TOUCHED
    if name in SENSING:  # wrong data before has shaped the map and the path
        begin = 0
    log, case_then = log.as_of(begin), case.as_of(begin)
    make = nothing if name == CONTROL else REMEDIES[name][0]
    limit_s = case.end_s + MORE_TIME if touched else log.config.episode.time_limit
    change = make(log, case_then)
    if again:
        change = replace(change, config=replace(change.config, seed=change.config.seed + 1))
    if not stack:
        result, note = go_on(log, case_then, change, at=begin, limit_s=limit_s), ""
    else:
        with restarted_stack(log, stack) as restarted:
            result = go_on(log, case_then, change, at=begin, limit_s=limit_s, restarted=restarted)
        differing, answers = restarted.differing, restarted.answers
        note = f"{differing} of {answers} answers before it differ from the recorded"
        note = note if differing else ""
    saves = result.outcome == "success" or (touched and result.outcome not in HARM)
    took = result.sim_time_s - case.moments[begin].time_ns * 1e-9
    return Check(name, begin, result.outcome, result.sim_time_s, saves, again), took, note


def checkable(log: Log) -> bool:
    """Return whether a log has a failure, sweeps and states, which a check needs."""
    return log.result["outcome"] not in ("success", "error") and log.record != "decisions"


def refuse_success(log: Log) -> None:
    """Raise an InputError if a log is that of a success."""
    if not checkable(log):
        raise InputError(
            f"log '{log.path}': {log.result['outcome']}, expected a failure, recorded in full"
        )
