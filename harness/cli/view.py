"""`wayproof view`: show a log in the Rerun viewer, with the map of each decision."""

from __future__ import annotations

import argparse
import gc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from wayproof.harness.cli.verb import Document, Verb, add_unchecked, check_log
from wayproof.harness.errors import InputError

if TYPE_CHECKING:
    from wayproof.harness.study.episodes import Entry
    from wayproof.harness.viewer.rerun_view import View


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Show one log, two side by side, one that is being written, or list those of a study."""
    if options.log.is_dir():
        return _study(options, console)
    if options.twin or options.failed:
        raise InputError(f"--twin, --failed: '{options.log}' is not the folder of a study")
    if options.number is not None:
        raise InputError(f"got number {options.number}, expected the folder of a study before it")
    if options.live:
        return _live(options, console)
    return _show([options.log] + ([options.compare] if options.compare else []), options, console)


def _show(paths: list[Path], options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    from wayproof.harness.viewer.rerun_view import check_view, view

    check_view(options.save)
    for path in paths:
        check_log(path, options)
    with console.status("making the maps again"), _without_collector():
        shown = view(paths, options.save, options.allow_plugins)
    return _shown(shown, console)


def _live(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    if options.compare:
        raise InputError("--live: expected one log, and no --compare")
    from wayproof.harness.viewer.rerun_view import view_live

    with console.status("following the log"):
        shown = view_live(options.log, options.save, options.allow_plugins)
    return _shown(shown, console)


def _shown(shown: View, console: Console) -> tuple[int, Document]:
    where = f"{shown.saved}, {shown.megabytes:.1f} MB" if shown.saved else "in the viewer"
    console.print(
        f"{sum(shown.decisions)} decisions in {shown.wall_time_s:.1f} s: {where}",
        soft_wrap=True,
        highlight=False,
    )
    return 0, asdict(shown)


def _study(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """List the episodes of a study, or show one of them, by itself or beside its twin."""
    from wayproof.harness.study.episodes import entries_of, find_entry

    if options.live or options.compare:
        raise InputError("--live, --compare: expected a log, got the folder of a study")
    entries = entries_of(options.log, options.allow_plugins)
    if options.number is None:
        if options.save is not None or options.twin:
            raise InputError("--save, --twin: expected the number of an episode after the folder")
        _print_entries(options, entries, console)
        return 0, {"episodes": [asdict(one) for one in entries]}
    found = find_entry(options.log, entries, options.number)
    if found.state == "running":
        options.log = Path(found.log)
        return _live(options, console)
    if options.twin and not found.twin:
        raise InputError(f"--twin: episode {found.number} has no twin with a log")
    paths = [Path(found.log)] + ([Path(found.twin)] if options.twin else [])
    return _show(paths, options, console)


def _print_entries(options: argparse.Namespace, entries: list[Entry], console: Console) -> None:
    from rich.table import Table

    from wayproof.harness.study.episodes import unplanned_in_words

    table = Table(box=None, pad_edge=False)
    for title in ("N", "episode", "seed", "outcome", "cause"):
        table.add_column(title, justify="right" if title in ("N", "seed") else "left")
    shown = [one for one in entries if one.failed or not options.failed]
    for one in shown:
        words = one.outcome if one.state == "ended" else f"{one.state} {one.outcome}".strip()
        table.add_row(str(one.number), one.name, str(one.seed), words, one.cause)
    console.print(table)
    failed = sum(one.failed for one in entries)
    ended = sum(one.state == "ended" for one in entries)
    console.print(f"{len(entries)} episodes, {ended} ended, {failed} failed", highlight=False)
    if other := unplanned_in_words(options.log, options.allow_plugins):
        console.print(other, soft_wrap=True, highlight=False)
    if ended:
        line = f"next: wayproof view {options.log} N, or N --twin for two side by side"
        console.print(line, soft_wrap=True, highlight=False)


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
    parser.add_argument(
        "log", metavar="LOG", type=Path, help="log file, or folder of a study to list its episodes"
    )
    parser.add_argument(
        "number", metavar="N", type=int, nargs="?", help="number of an episode in that list"
    )
    parser.add_argument(
        "--twin", action="store_true", help="show the episode of a study beside its twin"
    )
    parser.add_argument(
        "--failed", action="store_true", help="list the episodes of a study that failed alone"
    )
    parser.add_argument(
        "--live", action="store_true", help="follow a log that is being written, up to its end"
    )
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
    help="show a log in the Rerun viewer, also while it is being written; "
    "or list the episodes of a study and show one",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof view logs/warehouse-drone-3.mcap --save drone.rrd",
)
