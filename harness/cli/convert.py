"""`wayproof convert`: write a log as a file for another viewer."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from rich.console import Console

from wayproof.harness.cli.verb import Document, Verb, add_unchecked, check_log
from wayproof.harness.errors import InputError

ENDING = ".mcap"


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Write the file."""
    out: Path = options.foxglove
    if out.suffix != ENDING:
        raise InputError(f"--foxglove: got '{out}', expected a name that ends in {ENDING}")
    if out.resolve() == options.log.resolve():
        raise InputError(f"--foxglove: got the log itself, '{out}'")
    check_log(options.log, options)
    from wayproof.harness.viewer.foxglove import convert

    began = time.perf_counter()
    with console.status("making the maps again"):
        decisions = convert(options.log, out, options.allow_plugins)
    wall, size = time.perf_counter() - began, out.stat().st_size * 1e-6
    console.print(
        f"{decisions} decisions in {wall:.1f} s: {out}, {size:.1f} MB",
        soft_wrap=True,
        highlight=False,
    )
    return 0, {"out": str(out), "decisions": decisions, "megabytes": size, "wall_time_s": wall}


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("log", metavar="LOG", type=Path, help="log file")
    parser.add_argument(
        "--foxglove",
        type=Path,
        required=True,
        metavar="FILE.mcap",
        help="MCAP file with schemas that Foxglove draws",
    )
    add_unchecked(parser)
    parser.add_argument(
        "--allow-plugins",
        action="store_true",
        help="run the planner or controller that the log names as module:Class or FILE.py:Class",
    )


VERB = Verb(
    help="convert a log to a file that Foxglove draws without configuration",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof convert logs/warehouse-drone-3.mcap --foxglove drone.mcap",
)
