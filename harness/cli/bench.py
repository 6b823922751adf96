"""`wayproof bench`: measure the speed and correctness of one stage on this machine."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.console import Console

from wayproof.harness.cli.verb import Document, Verb, add_log_folder, add_stack, stack_of
from wayproof.harness.errors import InputError

FILES = {
    "worlds": "folder with the worlds of a published benchmark: barn, dodge",
    "scenarios": "planning problems on a voxel map (.3dscen): plan",
}
"""Option that names files of the user -> contents of the files."""


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Measure one stage."""
    from wayproof.harness.bench.published import Files
    from wayproof.harness.bench.stages import run_stage
    from wayproof.harness.bench.table import print_rows
    from wayproof.harness.config import StackConfig

    given = [name for name in FILES if getattr(options, name) is not None]
    if len(given) > 1:
        raise InputError(f"got --{' and --'.join(given)}, expected one of them")
    stack = stack_of(options)
    files = [Files(f"--{name}", getattr(options, name), options.logs, stack) for name in given]
    if stack != StackConfig() and given != ["worlds"]:
        raise InputError(f"--stack: got bench {options.stage}, expected one of: barn, dodge")
    source = files[0] if files else None
    rows = run_stage(
        options.stage, options.repeats, options.seed, source, options.rows, options.only
    )
    print_rows(console, f"bench {options.stage}, seed {options.seed}", rows)
    return 0, {"rows": rows}


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "stage", metavar="STAGE", help="name of a benchmark; an unknown name lists all"
    )
    parser.add_argument(
        "--repeats",
        type=int,
        metavar="N",
        help="number of sweeps, queries or episodes of each row (default: depends on the stage)",
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of the scenes (default: 0)")
    for name, said in FILES.items():
        parser.add_argument(f"--{name}", type=Path, metavar="PATH", help=said)
    parser.add_argument(
        "--rows",
        type=Path,
        metavar="FILE",
        help="keep the row of each episode in FILE, and continue from it: crossing, worlds",
    )
    parser.add_argument(
        "--only",
        metavar="PART",
        help="measure one part only; an unknown name lists all: coverage, loop, map, robots",
    )
    add_stack(parser)
    add_log_folder(parser)


VERB = Verb(
    help="measure how fast one stage is on this machine, and check its results",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof bench rays --json",
)
