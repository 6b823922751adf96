"""`wayproof compare`: compare two runs of a study, pair by pair."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from rich.console import Console

from wayproof.harness.cli import shared
from wayproof.harness.cli.study import print_study
from wayproof.harness.cli.verb import Document, Verb, arg, arguments, write_summaries
from wayproof.harness.study.default_gates import DEFAULT_GATES


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Compare two folders of one study; exit codes as for a study."""
    from wayproof.harness.study.compare import compare

    compared = compare(options.before, options.after, options.gate or (), options.allow_plugins)
    result = compared.result
    write_summaries(options, result, options.allow_inconclusive)
    if options.html is not None:
        from wayproof.harness.study.report.builds import write_comparison

        write_comparison(compared, options.before, options.after, options.html)
    print_study(console, result)
    identical = [one.against for one in result.arms if one.against]
    if identical and not any(one.changed for one in identical):
        pairs = sum(one.pairs for one in identical)
        console.print(f"every decision is the same in all {pairs} pairs")
    document = {**asdict(result), "verdict": result.verdict}
    return result.exit_code(options.allow_inconclusive), document


VERB = Verb(
    help="compare two runs of a study in pairs; exit code 1 if a gate fails, 3 if undecided",
    add_arguments=arguments(
        arg("A", "folder of the reference run of a study", Path, dest="before"),
        arg("B", "folder of another run of the same study", Path, dest="after"),
        arg(
            "--gate GATE",
            f"condition on B against A, repeatable (default: {', '.join(DEFAULT_GATES)})",
            action="append",
        ),
        arg("--html FILE", "write the comparison as an HTML page", Path),
        shared.summaries,
        shared.inconclusive,
        shared.plugins,
    ),
    run=run,
    example="wayproof compare logs/before logs/after --gate 'success.drop <= 0.05'",
)
