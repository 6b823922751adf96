"""`wayproof recover`: write the readable part of a broken log as a valid log."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from rich.console import Console

from wayproof.harness.cli.verb import Document, Verb


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Write the readable part of a log."""
    from wayproof.harness.log.recover import recover

    recovery = recover(options.broken, options.out, options.allow_plugins)
    if recovery.written is None:
        console.print(
            f"nothing to recover: {recovery.log} is whole, {recovery.decisions} decisions",
            soft_wrap=True,
        )
        return 0, asdict(recovery)
    console.print(
        f"recovered: {recovery.decisions} decisions, {recovery.sim_time_s:.1f} s simulated; "
        f"{recovery.damage or 'the log ends without a result'}",
        soft_wrap=True,
    )
    console.print(f"log: {recovery.written}", soft_wrap=True, highlight=False)
    return 0, asdict(recovery)


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("broken", metavar="LOG", type=Path, help=".partial file or damaged log")
    parser.add_argument(
        "--allow-plugins",
        action="store_true",
        help="run the planner or controller that the log names as module:Class or FILE.py:Class",
    )
    parser.add_argument(
        "--out",
        type=Path,
        metavar="FILE",
        help="name of the new log (default: NAME-recovered.mcap)",
    )


VERB = Verb(
    help="write the readable part of an unfinished or damaged log as a valid log",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof recover logs/warehouse-drone-3.mcap.partial",
)
