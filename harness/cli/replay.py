"""`wayproof replay`: recompute every decision of a log and compare it bit by bit."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.text import Text

from wayproof.harness.cli import fork, shared, simulate, what_if
from wayproof.harness.cli.differences import print_differences, print_scope
from wayproof.harness.cli.verb import Document, Verb, arg, arguments, replay_each
from wayproof.harness.errors import InputError

if TYPE_CHECKING:
    from wayproof.harness.replay.replay import Replay

MOST_JOBS = 1024


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Recompute the decisions of one or more logs; exit code 1 if any differs."""
    if options.jobs is not None and not 1 <= options.jobs <= MOST_JOBS:
        raise InputError(f"--jobs: got {options.jobs}, expected 1 to {MOST_JOBS}")
    return replay_each(_replay, options, console)


def _replay(path: Path, options: argparse.Namespace, console: Console) -> tuple[bool, Document]:
    from wayproof.harness.forked import cores
    from wayproof.harness.replay.replay import replay

    jobs = options.jobs or cores()
    replayed = replay(path, options.allow_plugins, jobs=jobs)
    print_replay(console, replayed)
    return replayed.identical, asdict(replayed)


def print_replay(console: Console, replayed: Replay) -> None:
    """Print the verdict of a replay, the first differences, and what the verdict covers.

    Of another program's log that does not come out the same: the version that decided it.
    """
    program = replayed.program
    if replayed.identical:
        text = Text.assemble(
            ("identical", "bold green"), f": {replayed.decisions} of {replayed.decisions} decisions"
        )
        if program is not None:
            text.append(f", recorded by another build, wayproof {program.version}")
    elif program is not None:
        console.print(
            Text.assemble(
                ("another program's", "bold yellow"),
                f": {replayed.differing} of {replayed.decisions} decisions differ from those of "
                f"wayproof {program.version}, code {program.code}; to replay it: "
                f"install Wayproof {program.version}; {replayed.log}",
            )
        )
        return
    else:
        first = replayed.first_difference
        where = "" if first is None else f", first {first}"
        if first is None and not replayed.contradictions:
            where = ", only the log's own chain"
        text = Text.assemble(
            ("differs", "bold red"),
            f": {replayed.differing} of {replayed.decisions} decisions{where}",
        )
    text.append(f"; {replayed.wall_time_s:.1f} s; chain {replayed.chain}; {replayed.log}")
    console.print(text)
    print_differences(console, [*replayed.differences, *replayed.contradictions])
    print_scope(console, replayed.scope)


VERB = Verb(
    help="recompute every decision of a log and compare bit by bit, or change one thing",
    add_arguments=arguments(
        shared.log_paths,
        arg(
            "--jobs N",
            "number of processes, each from a state in the log (default: all cores)",
            int,
        ),
    ),
    run=run,
    example="wayproof replay logs/warehouse-drone-3.mcap",
    kinds={"what-if": what_if.VERB, "fork": fork.VERB, "simulate": simulate.VERB},
)
