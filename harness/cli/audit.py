"""`wayproof audit`: check every committed path against its map by independent code."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING

from rich.console import Console
from rich.text import Text

from wayproof.harness.cli import shared
from wayproof.harness.cli.verb import Document, Verb, arg, arguments, check_log, one_or_all

if TYPE_CHECKING:
    from wayproof.harness.replay.audit import Audit

SHOWN_VIOLATIONS = 10


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Check the decisions of one or more logs."""
    from wayproof.harness.replay.audit import audit

    audits = []
    for path in options.log:
        check_log(path, options)
        audits.append(
            audit(
                path,
                options.policy,
                allow_plugins=options.allow_plugins,
                measured_only=options.measured_only,
                as_measured=options.as_measured,
            )
        )
        print_audit(console, audits[-1])
    code = 1 if any(one.violations for one in audits) else 0
    return code, one_or_all("audits", [asdict(one) for one in audits])


def print_audit(console: Console, audited: Audit) -> None:
    """Print the verdict of an audit and the first violations."""
    count = len(audited.violations)
    verdict = ("no violation", "bold green")
    if count:
        rules = ", ".join(f"{number} {rule}" for rule, number in audited.rules.items())
        verdict = (f"{count} violation{'s'[: count > 1]} ({rules})", "bold red")
    text = Text.assemble(
        verdict,
        f" in {audited.decisions} decisions, policy '{audited.policy}': ",
        f"{audited.swept} paths swept, {audited.stops} forced stops, ",
        f"{audited.recoveries} recoveries, {audited.late} late, ",
        f"{audited.reasons} reasons; {audited.log}",
    )
    console.print(text)
    filtered = audited.filtered
    if filtered is not None and filtered.filtered_m > 0.0:
        counts = filtered.returns.items()
        console.print(
            f"  filters: {filtered.filtered_m:.2f} of {filtered.way_m:.2f} m of these paths, in "
            f"{len(filtered.decisions)} decisions, are free by the word of a filter alone"
            + "".join(f"; {name} changed {count} returns" for name, count in counts)
        )
    for violation in audited.violations[:SHOWN_VIOLATIONS]:
        console.print(f"  {violation.sequence}: {violation.rule}: {violation.text}")
    if count > SHOWN_VIOLATIONS:
        console.print(f"  and {count - SHOWN_VIOLATIONS} more")


POLICIES = ("forbid", "penalize", "allow")
"""Values of `maps.UnknownPolicy`."""

VERB = Verb(
    help="check that every committed path lay in space that its map knew to be free",
    add_arguments=arguments(
        shared.log_paths,
        shared.unchecked,
        arg(
            "--policy POLICY",
            f"check paths under this policy for unknown space: {', '.join(POLICIES)} "
            "(default: the log's)",
            choices=POLICIES,
        ),
        arg(
            "--measured-only",
            "check paths against what was measured alone, also where prior.policy=admit",
        ),
        arg(
            "--as-measured",
            "check paths against the returns as they came, without the word of any filter",
        ),
    ),
    run=run,
    example="wayproof audit logs/warehouse-drone-3.mcap",
)
