"""`wayproof bench`: measure the speed of one part on this machine."""

from __future__ import annotations

import argparse

from rich.console import Console

from wayproof.harness.cli.verb import Document, Verb


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Measure one part."""
    from wayproof.harness.bench import run_bench
    from wayproof.harness.bench.table import print_rows

    rows = run_bench(options.part, options.repeats, options.seed)
    print_rows(console, f"bench {options.part}, seed {options.seed}", rows)
    return 0, {"rows": rows}


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("part", metavar="PART", help="rays, map, plan, loop or robots")
    parser.add_argument(
        "--repeats",
        type=int,
        metavar="N",
        help="number of sweeps, queries, episodes or runs (default: depends on the part)",
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of the scenes (default: 0)")


VERB = Verb(
    help="measure how fast one part is on this machine, beside a peer in the same run",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof bench rays --json",
)
