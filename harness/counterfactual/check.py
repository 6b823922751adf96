"""Counterfactual check of a cause: does the failure go away with one thing put right?

A control without a change must fail again, or the check is inconclusive. Then one remedy at a time
is tried. A contact or a fall is simulated from one second before its last chance, and if nothing
helps there, from the start; an episode that ran out of time or got stuck is simulated from the
start. The answer of the check decides the cause.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from wayproof.harness.attribution.case import Case, read_case
from wayproof.harness.attribution.finding import CAUSES, Finding
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
from wayproof.harness.replay.answers import restarted_stack

BEFORE = 1.0
"""Time before the last chance at which a remedy begins, s: it needs time to take effect."""

SHOWN_BY_THEIR_OWN_TEST = ("impossible", "planner", "tracking", "stack_held", "exploration")
"""Causes that facts alone establish: what is missing may be impossible to put right."""

HELPS_ALWAYS = "true_map"
"""Remedy that helps after many causes: complete knowledge, which no sensor gives."""

ONLY_CONFIRMS = ("guard", "no_guard")
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
    simulated, note = 0.0, ""
    for begin in _begins(case, finding):
        for name in (CONTROL, *names):
            if simulated >= most_s:
                break
            one, took, other = _try(log, case, finding, name, begin, stack)
            checks.append(one)
            note = note or other
            simulated += took
            if name == CONTROL and (one.saves or one.outcome != case.outcome):
                break
            if not thorough and one.saves and finding.cause in REMEDIES[name][1]:
                break
        if any(one.saves for one in checks) or simulated >= most_s:
            break
    if simulated >= most_s and not any(one.saves for one in checks):  # the rest may save it
        spent = f"the bound of {most_s:g} s of simulated time left remedies untried"
        note = f"{spent}; {note}" if note else spent
        return Verdict(
            finding, answer="inconclusive", checks=tuple(checks), simulated_s=simulated, note=note
        )
    settled, answer = settle(finding, checks, recorded=case.outcome)
    if answer == "inconclusive":
        why = why_inconclusive(finding, checks, recorded=case.outcome)
        note = f"{why}; {note}" if note else why
    return Verdict(settled, answer, checks=tuple(checks), simulated_s=simulated, note=note)


def settle(finding: Finding, checks: Sequence[Check], recorded: str) -> tuple[Finding, str]:
    """Return the cause that the checks leave, and the answer.

    A control that ends otherwise than recorded shows nothing. If a remedy of the cause saves the
    robot, the cause is confirmed. If only others do, it is replaced by the first of their causes in
    the order of `CAUSES`, that of a true map last; the guard replaces none, as a robot that stands
    is saved from much, nor does its absence. If none saves it, a cause that facts alone establish
    stands, one of which a remedy was tried becomes `unexplained`, and of any other nothing is
    shown.

    Args:
        finding: Cause by the facts.
        checks: Outcomes of the control and the remedies.
        recorded: Outcome of the episode.
    """
    tried = [one for one in checks if one.remedy != CONTROL]
    if not tried or _other_control(checks, recorded) is not None:
        return finding, "inconclusive"
    saving = [one.remedy for one in tried if one.saves and _bears_out(one.remedy, finding.cause)]
    borne_out = [cause for name in saving for cause in REMEDIES[name][1]]
    if finding.cause in borne_out:
        return finding, "confirmed"
    if saving and all(name in ONLY_CONFIRMS for name in saving):
        return finding, "inconclusive"
    saving = [name for name in saving if name not in ONLY_CONFIRMS]
    if saving:
        saving = [name for name in saving if name != HELPS_ALWAYS] or saving
        cause, by = min(
            ((_led_to(name, checks), name) for name in saving), key=lambda one: CAUSES.index(one[0])
        )
        evidence = f"{by.replace('_', ' ')} alone saves the robot"
    elif finding.cause in (*SHOWN_BY_THEIR_OWN_TEST, "unexplained"):
        return finding, "confirmed"
    elif not _is_tried(finding.cause, tried):
        return finding, "inconclusive"
    else:
        cause, evidence = "unexplained", "no remedy saves the robot"
    before = f"{evidence}; the facts alone gave {finding.cause}: {finding.evidence}"
    return Finding(cause, before, finding.decision, finding.place), "changed"


def why_inconclusive(finding: Finding, checks: Sequence[Check], recorded: str) -> str:
    """Return why checks show nothing of a cause, in words; arguments as of `settle`."""
    control = _other_control(checks, recorded)
    if control is not None:
        return f"without a change it ended as {control.outcome}, not as recorded"
    tried = [one for one in checks if one.remedy != CONTROL]
    if not tried:
        return "no remedy was tried"
    saving = [one.remedy.replace("_", " ") for one in tried if one.saves]
    if saving:
        return f"{' and '.join(saving)} alone saves it, which says nothing about {finding.cause}"
    return f"no remedy for {finding.cause} was tried, and no other saves it"


def _other_control(checks: Sequence[Check], recorded: str) -> Check | None:
    """Return the first control that did not end as recorded; None without one."""
    controls = [one for one in checks if one.remedy == CONTROL]
    return next((one for one in controls if one.saves or one.outcome != recorded), None)


def _is_tried(cause: str, tried: Sequence[Check]) -> bool:
    return any(cause in REMEDIES[one.remedy][1] for one in tried)


def _in_order(case: Case, cause: str) -> list[str]:
    """Return the remedies that apply, those of a cause first and a true map last."""
    names = [name for name in REMEDIES if case.outcome in ONLY_AFTER.get(name, (case.outcome,))]
    on_trial = case.config.stack.name != BUILTIN
    names = [name for name in names if not on_trial or name in ON_TRIAL]
    names = [name for name in names if _bears_out(name, cause) and _differs(name, case)]
    return sorted(names, key=lambda name: (cause not in REMEDIES[name][1], name == HELPS_ALWAYS))


def _differs(remedy: str, case: Case) -> bool:
    """Return whether a remedy changes anything in a case."""
    if remedy == "no_movers":
        return any(moment.truth.movers for moment in case.moments[:1])
    if remedy in ("guard", "no_guard"):
        on_trial, guarded = case.config.stack.name != BUILTIN, case.config.stack.guard
        return on_trial and guarded == (remedy == "no_guard")
    if remedy == "forbidden_unknown":
        return case.config.costmap.unknown_policy != "forbid" or admits_by_prior(case.config)
    return True


def _led_to(remedy: str, checks: Sequence[Check]) -> str:
    """Return the cause that a remedy indicates."""
    if remedy != HELPS_ALWAYS:
        return REMEDIES[remedy][1][0]
    touched = any(one.remedy == CONTROL and one.outcome == "collision" for one in checks)
    return "missed_obstacle" if touched else "ghost_obstacle"


def _bears_out(remedy: str, cause: str) -> bool:
    """Return whether a remedy that saves the robot confirms a cause."""
    return remedy not in ONLY_SHOWN or cause in REMEDIES[remedy][1]


def _begins(case: Case, finding: Finding) -> Iterator[int]:
    """Yield the decisions at which remedies begin, in turn until one saves the robot."""
    if case.outcome in TOUCHED:
        before_ns = case.moments[finding.decision].time_ns - round(BEFORE * 1e9)
        at = sum(moment.time_ns < before_ns for moment in case.moments)
        if at > 0:
            yield at
    yield 0


def _try(
    log: Log, case: Case, finding: Finding, name: str, begin: int, stack: str
) -> tuple[Check, float, str]:
    """Try one remedy from a decision on, or from the start.

    Returns:
        The outcome, the simulated time, s, and a note on the answers of the stack before.
    """
    touched = case.outcome in TOUCHED
    if name in FROM_THE_START:
        begin = 0
    log, case_then = log.as_of(begin), case.as_of(begin)
    make = nothing if name == CONTROL else REMEDIES[name][0]
    limit_s = case.end_s + MORE_TIME if touched else log.config.episode.time_limit
    change = make(log, case_then)
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
    return Check(name, begin, result.outcome, result.sim_time_s, saves), took, note


FROM_THE_START = ("true_pose", "true_ranges")
"""Remedies that begin at the start: wrong data before has shaped the map and the path."""


def checkable(log: Log) -> bool:
    """Return whether a log has a failure, sweeps and states, which a check needs."""
    return log.result["outcome"] not in ("success", "error") and log.record != "decisions"


def refuse_success(log: Log) -> None:
    """Raise an InputError if a log is that of a success."""
    if not checkable(log):
        raise InputError(
            f"log '{log.path}': {log.result['outcome']}, expected a failure, recorded in full"
        )
