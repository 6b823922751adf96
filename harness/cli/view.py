"""`wayproof view`: show a log in the Rerun viewer, with the map of each decision."""

from __future__ import annotations

import argparse
import gc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

from rich.console import Console

from wayproof.harness.cli.verb import Document, Verb, add_unchecked, check_log
from wayproof.harness.errors import InputError

ENDING = ".rrd"


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Show one log, or two side by side."""
    if options.save is not None and options.save.suffix != ENDING:
        raise InputError(f"--save: got '{options.save}', expected a name that ends in {ENDING}")
    paths = [options.log] + ([options.compare] if options.compare else [])
    for path in paths:
        check_log(path, options)
    with console.status("making the maps again"), _without_collector():
        from wayproof.harness.viewer.rerun_view import view

        shown = view(paths, options.save, options.allow_plugins)
    where = f"{shown.saved}, {shown.megabytes:.1f} MB" if shown.saved else "in the viewer"
    console.print(
        f"{sum(shown.decisions)} decisions in {shown.wall_time_s:.1f} s: {where}",
        soft_wrap=True,
        highlight=False,
    )
    return 0, asdict(shown)


@contextmanager
def _without_collector() -> Iterator[None]:
    """Switch the cyclic garbage collector off: it takes a tenth of the time of the imports."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("log", metavar="LOG", type=Path, help="log file")
    parser.add_argument(
        "--save",
        type=Path,
        metavar="FILE.rrd",
        help="write a Rerun recording instead of opening the viewer",
    )
    parser.add_argument(
        "--compare", type=Path, metavar="LOG2", help="second log to show beside the first"
    )
    add_unchecked(parser)
    parser.add_argument(
        "--allow-plugins",
        action="store_true",
        help="run the planner or controller that the log names as module:Class or FILE.py:Class",
    )


VERB = Verb(
    help="show a log in the Rerun viewer: map, robot, truth and decisions on one timeline",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof view logs/warehouse-drone-3.mcap --save drone.rrd",
)
