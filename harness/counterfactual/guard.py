"""Check of a stack on trial from its log alone: the action of a guard.

The recorded answers are followed up to the first of the commands that led to the failure against
the referee's verdict. There the guard brakes, and the stack, which is not run, is silent: the body
stands. A control with all recorded answers must fail as recorded, or the check is inconclusive.
"""

from __future__ import annotations

from wayproof.harness.attribution.case import Case
from wayproof.harness.attribution.commanded import commands_to
from wayproof.harness.attribution.finding import Finding
from wayproof.harness.counterfactual.remedies import REMEDIES, go_on, guard, nothing
from wayproof.harness.counterfactual.verdict import (
    CONTROL,
    HARM,
    MORE_TIME,
    TOUCHED,
    Check,
    Verdict,
)
from wayproof.harness.log.reader import Log
from wayproof.harness.replay.answers import RecordedAnswers

GUARD = "guard"
"""Its name among `REMEDIES`."""


def check_by_guard(log: Log, case: Case, finding: Finding) -> Verdict:
    """Try the guard from the first command on that it would have cut, and settle the cause.

    Raises:
        InputError: The log has no state there, or does not replay.
    """
    commands = commands_to(case, case.end_s)
    if note := _undecided(log, case, commands):
        return Verdict(finding, answer="inconclusive", checks=(), simulated_s=0.0, note=note)
    first, checks = commands[0], list[Check]()
    log_then, case_then = log.as_of(first), case.as_of(first)
    for name, make, silent_from in (
        (CONTROL, nothing, len(case.moments)),
        (GUARD, guard, first + 1),
    ):
        result = go_on(
            log_then,
            case_then,
            change=make(log_then, case_then),
            at=first,
            limit_s=case.end_s + MORE_TIME,
            session=RecordedAnswers(log, silent_from),
        )
        saves = result.outcome not in HARM
        checks.append(Check(name, first, result.outcome, result.sim_time_s, saves))
        if result.outcome != case.outcome:
            break
    begin_s = case.moments[first].time_ns * 1e-9
    simulated = sum(one.end_s - begin_s for one in checks)
    answer, note = settle_by_guard(finding, checks)
    return Verdict(finding, answer, checks=tuple(checks), simulated_s=simulated, note=note)


def settle_by_guard(finding: Finding, checks: list[Check]) -> tuple[str, str]:
    """Return the answer, and a note; the guard can confirm a cause, and shows nothing else.

    Args:
        finding: Cause by the facts.
        checks: The control, and the guard if the control failed as recorded.
    """
    if len(checks) == 1:
        outcome = checks[0].outcome
        note = f"with all recorded answers it ended as {outcome}, not as recorded"
        return "inconclusive", note
    first, saves = checks[-1].begin, checks[-1].saves
    against_verdict = finding.cause in REMEDIES[GUARD][1]
    if saves and against_verdict:
        return "confirmed", ""
    does = "keeps the robot from it" if saves else "does not keep the robot from it"
    beside = "" if against_verdict else f", which says nothing about {finding.cause}"
    return "inconclusive", f"cutting decision {first} {does}{beside}"


def _undecided(log: Log, case: Case, commands: tuple[int, ...]) -> str:
    """Return why the guard can show nothing, in words; empty if it can."""
    live = "--stack STACK lets the stack itself go on"
    if log.config.stack.guard:
        return f"the guard was on; {live}"
    if case.outcome not in TOUCHED:
        return f"the guard can only keep the robot from a contact; {live}"
    if not commands:
        return f"the referee admitted the commands that led to it, so the guard cuts none; {live}"
    return ""
