"""Cause of a failure, and the check of a cause, in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from wayproof.harness.attribution import Finding
    from wayproof.harness.counterfactual.verdict import Check, Verdict


def print_finding(console: Console, finding: Finding, outcome: str) -> None:
    """Print the cause and its evidence; only before a contact or a fall was there a last chance."""
    from wayproof.harness.counterfactual.verdict import TOUCHED

    line = Text.assemble("cause: ", (finding.cause, "bold red"), f": {finding.evidence}")
    console.print(line)
    x, y, z = finding.place
    chance = "last chance at" if outcome in TOUCHED and finding.decision >= 0 else "at"
    console.print(f"  {chance} decision {finding.decision}; at ({x:.2f}, {y:.2f}, {z:.2f})")


def print_verdict(console: Console, verdict: Verdict) -> None:
    """Print the result of each corrected simulation, a line each, and the conclusion."""
    if verdict.checks:
        _print_checks(console, verdict.checks)
    console.print(f"check: {in_words(verdict)}")


def in_words(verdict: Verdict) -> str:
    """Return the conclusion of a check in words."""
    note = f"; {verdict.note}" if verdict.note else ""
    if verdict.answer == "inconclusive":
        return f"inconclusive: {verdict.note}" if verdict.note else "inconclusive"
    saved = [one for one in verdict.checks if one.saves and not one.again]
    saving = [one.remedy.replace("_", " ") for one in saved]
    by = f"; {', '.join(saving)} would have saved it" if saving else "; nothing saves it"
    return f"{verdict.finding.cause} is {verdict.answer}{by}{note}"


def _print_checks(console: Console, checks: Sequence[Check]) -> None:
    table = Table("with", "from decision", "outcome", "at, s", "saves the robot")
    for one in checks:
        saves = Text("yes", "bold green") if one.saves else "no"
        remedy, begin = one.remedy.replace("_", " "), str(one.begin)
        remedy += ", other noise" if one.again else ""
        table.add_row(remedy, begin, one.outcome, f"{one.end_s:.1f}", saves)
    console.print(table)
