"""`wayproof replay`: every decision of a log, recomputed and compared bit by bit."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING

from rich.console import Console
from rich.text import Text

from harness.verbs.verb import Document, Verb, add_log_paths, one_or_all

if TYPE_CHECKING:
    from harness.replay import Replay


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Recompute the decisions of one or more logs."""
    from harness.replay import replay

    replays = []
    for path in options.log:
        replays.append(replay(path, options.allow_plugins))
        print_replay(console, replays[-1])
    code = 0 if all(one.identical for one in replays) else 1
    return code, one_or_all("replays", [asdict(one) for one in replays])


def print_replay(console: Console, replayed: Replay) -> None:
    """One replay's verdict in a line."""
    if replayed.identical:
        text = Text.assemble(
            ("identical", "bold green"), f": {replayed.decisions} of {replayed.decisions} decisions"
        )
    else:
        first = "none" if replayed.first_difference is None else str(replayed.first_difference)
        text = Text.assemble(
            ("differs", "bold red"),
            f": {replayed.differing} of {replayed.decisions} decisions,"
            f" first {first} in {', '.join(replayed.fields) or 'the chain'}",
        )
    text.append(f"; {replayed.wall_time_s:.1f} s; chain {replayed.chain}; {replayed.log}")
    console.print(text, soft_wrap=True)


VERB = Verb(
    help="recompute every decision of a log and compare bit by bit",
    add_arguments=add_log_paths,
    run=run,
    example="wayproof replay logs/warehouse-drone-3.mcap",
)
