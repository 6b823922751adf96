"""`wayproof bench`: measure the speed of one part on this machine."""

from __future__ import annotations

import argparse

from rich.console import Console

from wayproof.harness.cli.verb import Document, Verb, arg, arguments


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Measure one part."""
    from wayproof.harness.bench import run_bench
    from wayproof.harness.bench.table import print_rows

    rows = run_bench(options.part, options.repeats, options.seed)
    print_rows(console, f"bench {options.part}, seed {options.seed}", rows)
    return 0, {"rows": rows}


VERB = Verb(
    help="measure how fast one part is on this machine, beside a peer in the same run",
    add_arguments=arguments(
        arg("PART", "rays, map, plan, loop or robots"),
        arg(
            "--repeats N",
            "number of sweeps, queries, episodes or runs (default: depends on the part)",
            int,
        ),
        arg("--seed SEED", "seed of the scenes", int, 0),
    ),
    run=run,
    example="wayproof bench rays --json",
)
