"""`wayproof view`: show a log in the Rerun viewer, or draw it as an image or a movie."""

from __future__ import annotations

import argparse
import gc
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from wayproof.harness.cli import shared
from wayproof.harness.cli.verb import Document, Verb, arg, arguments, check_ending, check_log
from wayproof.harness.errors import InputError

if TYPE_CHECKING:
    from wayproof.harness.study.episodes import Entry
    from wayproof.harness.viewer.rerun_view import View


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Show one log, two side by side, one that is being written, or list those of a study."""
    _check(options)
    if options.log.is_dir():
        return _study(options, console)
    if options.twin or options.failed:
        raise InputError(f"--twin, --failed: '{options.log}' is not the folder of a study")
    if options.number is not None:
        raise InputError(f"got number {options.number}, expected the folder of a study before it")
    return _one(options.log, options, console)


def _check(options: argparse.Namespace) -> None:
    check_ending("--png", options.png, ".png")
    drawn = [f"--{name}" for name in ("png", "movie") if getattr(options, name) is not None]
    if len(drawn) > 1 or (drawn and (options.save or options.compare or options.live)):
        raise InputError(f"{' and '.join(drawn)}: goes with no other way to show a log")
    if options.decision is not None and options.decision < 0:
        raise InputError(f"--decision: got {options.decision}, expected 0 or more")
    if options.live and options.compare:
        raise InputError("--live: expected one log, and no --compare")


def _one(path: Path, options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Show one log, as the options say."""
    if options.png is not None or options.movie is not None:
        return _draw(path, options, console)
    if options.live:
        return _live(path, options, console)
    return _show([path] + ([options.compare] if options.compare else []), options, console)


def _draw(path: Path, options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Draw the map, the truth and the plans from above: one decision, or all of them."""
    check_log(path, options)
    from wayproof.harness.viewer.movie import check_movie, draw_movie
    from wayproof.harness.viewer.top_view import draw_picture

    began, frames, out = time.perf_counter(), 1, options.movie or options.png
    with console.status("making the maps again"):
        if options.movie is not None:
            check_movie(out, options.period)
            frames = draw_movie(path, out, options.period, options.allow_plugins)
            drawn = f"{frames} frames"
        else:
            number = _decision(path, options)
            draw_picture(path, number, out, options.allow_plugins)
            drawn = f"decision {number}"
    wall, size = time.perf_counter() - began, out.stat().st_size * 1e-6
    console.print(f"{drawn} in {wall:.1f} s: {out}, {size:.2f} MB")
    return 0, {"out": str(out), "frames": frames, "megabytes": size, "wall_time_s": wall}


def _decision(path: Path, options: argparse.Namespace) -> int:
    """Return the number of the decision to draw, by default the last one."""
    from wayproof.harness.log.reader import open_log

    if options.decision is not None:
        return int(options.decision)
    last = int(open_log(path, options.allow_plugins).result.get("decisions", "0")) - 1
    return max(last, 0)


def _show(paths: list[Path], options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    from wayproof.harness.viewer.rerun_view import check_view, view

    check_view(options.save)
    for path in paths:
        check_log(path, options)
    with console.status("making the maps again"), _without_collector():
        shown = view(paths, options.save, options.allow_plugins)
    return _shown(shown, console)


def _live(path: Path, options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    from wayproof.harness.viewer.rerun_view import view_live

    with console.status("following the log"):
        shown = view_live(path, options.save, options.allow_plugins)
    return _shown(shown, console)


def _shown(shown: View, console: Console) -> tuple[int, Document]:
    where = f"{shown.saved}, {shown.megabytes:.1f} MB" if shown.saved else "in the viewer"
    console.print(f"{sum(shown.decisions)} decisions in {shown.wall_time_s:.1f} s: {where}")
    return 0, asdict(shown)


def _study(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """List the episodes of a study, or show one of them, by itself or beside its twin."""
    from wayproof.harness.study.episodes import entries_of, find_entry

    if options.live or options.compare:
        raise InputError("--live, --compare: expected a log, got the folder of a study")
    entries = entries_of(options.log, options.allow_plugins)
    if options.number is None:
        if options.twin or options.save or options.png or options.movie:
            raise InputError("expected the number of an episode after the folder")
        _print_entries(options, entries, console)
        return 0, {"episodes": [asdict(one) for one in entries]}
    found = find_entry(options.log, entries, options.number)
    if found.state == "running":
        return _live(Path(found.log), options, console)
    if options.twin and not found.twin:
        raise InputError(f"--twin: episode {found.number} has no twin with a log")
    if options.twin:
        return _show([Path(found.log), Path(found.twin)], options, console)
    return _one(Path(found.log), options, console)


def _print_entries(options: argparse.Namespace, entries: list[Entry], console: Console) -> None:
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
    console.print(f"{len(entries)} episodes, {ended} ended, {failed} failed")
    if other := unplanned_in_words(options.log, options.allow_plugins):
        console.print(other)
    if ended:
        console.print(f"next: wayproof view {options.log} N, or N --twin for two side by side")


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


VERB = Verb(
    help="show a log in the Rerun viewer, also while it is written; draw it; list a study's logs",
    add_arguments=arguments(
        arg("LOG", "log file, or folder of a study to list its episodes", Path),
        arg("NUMBER", "number of an episode in that list", int, nargs="?"),
        arg("--save FILE.rrd", "write a Rerun recording instead of opening the viewer", Path),
        arg(
            "--png FILE.png", "draw the map, the truth and the plans at a decision from above", Path
        ),
        arg("--decision N", "number of the decision (default: the last)", int, needs=["--png"]),
        arg("--movie FILE", "draw all of it as a movie: a .gif or .mp4", Path),
        arg("--period S", "simulated time between frames, s", float, 0.2, needs=["--movie"]),
        arg("--compare LOG2", "second log to show beside the first", Path),
        arg("--live", "follow a log that is being written, up to its end"),
        arg("--twin", "show the episode of a study beside its twin"),
        arg("--failed", "list the episodes of a study that failed alone"),
        shared.unchecked,
        shared.plugins,
    ),
    run=run,
    example="wayproof view logs/warehouse-drone-3.mcap --save drone.rrd",
)
