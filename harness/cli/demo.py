"""`wayproof demo`: run both robots through a warehouse and replay both logs."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from wayproof.harness.cli.run import episode_name, run_one
from wayproof.harness.cli.verb import Document, Verb, add_log_folder, add_settings

if TYPE_CHECKING:
    from wayproof.harness.replay.replay import Replay
    from wayproof.harness.result import Result


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Run both robots and replay their logs."""
    from wayproof.harness.config_document import from_document, override
    from wayproof.harness.forked import cores
    from wayproof.harness.replay.replay import replay

    rows, spent = [], {"episodes": 0.0, "replays": 0.0}
    for robot in ("quadruped", "drone"):
        named = {"world": "warehouse", "robot": robot, "seed": options.seed}
        config = override(from_document(named), options.set)
        began = time.perf_counter()
        result = run_one(config, options.logs / f"{episode_name(config)}.mcap", console)
        ended = time.perf_counter()
        rows.append((robot, result, replay(Path(result.log), jobs=cores())))
        spent["episodes"] += ended - began
        spent["replays"] += time.perf_counter() - ended
    print_demo(console, rows)
    parts = ", ".join(f"{name} {seconds:.0f} s" for name, seconds in spent.items())
    console.print(f"time: {parts}", highlight=False)
    good = all(r.outcome == "success" and again.identical for _, r, again in rows)
    document = {"episodes": [{**asdict(r), "replay": asdict(again)} for _, r, again in rows]}
    return (0 if good else 1), document


def print_demo(console: Console, rows: Sequence[tuple[str, Result, Replay]]) -> None:
    """Print the verdicts of episodes and of their replays."""
    from wayproof.harness.clearance import true_in_metres

    table = Table(title="Verdicts: warehouse", title_justify="left")
    for heading in ("robot", "outcome", "time", "x real", "decisions", "clearance", "replay"):
        table.add_column(heading, justify="left" if heading in ("robot", "outcome") else "right")
    for title, result, replayed in rows:
        table.add_row(
            title,
            result.outcome,
            f"{result.sim_time_s:.1f} s",
            f"{result.sim_time_s / result.wall_time_s:.1f}",
            str(result.decisions),
            true_in_metres(result.min_clearance_m),
            "identical" if replayed.identical else "differs",
        )
    console.print(table)
    for _, result, _ in rows:
        console.print(f"log: {result.log}", soft_wrap=True, highlight=False)


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--seed", type=int, default=0, help="seed of the warehouse (default: 0)")
    add_settings(parser)
    add_log_folder(parser)


VERB = Verb(
    help="run both robots through a warehouse and replay both logs",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof demo --seed 4",
)
