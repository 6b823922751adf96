"""`wayproof compare`: is the second study worse than the first, pair by pair?"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from rich.console import Console

from harness.verbs.study import print_study
from harness.verbs.verb import Document, Verb, add_plugins

DEFAULT_GATES = ("success.drop <= 0", "collisions.rise <= 0")


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Compare two folders of one study; exit code 1 where a gate fails."""
    from harness.study.compare import compare

    result = compare(
        options.before, options.after, options.gate or DEFAULT_GATES, options.allow_plugins
    )
    print_study(console, result)
    return result.exit_code, asdict(result)


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("before", metavar="A", type=Path, help="folder of a study, the reference")
    parser.add_argument("after", metavar="B", type=Path, help="folder of the same study")
    parser.add_argument(
        "--gate",
        action="append",
        metavar="GATE",
        help=f"what B must keep against A, repeatable; by default {' and '.join(DEFAULT_GATES)}",
    )
    add_plugins(parser)


VERB = Verb(
    help="a paired comparison of two runs of a study; exit code 1 if the second is worse",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof compare logs/before logs/after --gate 'success.drop <= 0.05'",
)
