"""`wayproof picture`: draw the map, the truth and the plans from above, as image or movie."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from rich.console import Console

from wayproof.harness.cli.verb import Document, Verb, add_plugins, add_unchecked, check_log
from wayproof.harness.errors import InputError


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Draw one decision, or all of them."""
    _check(options)
    check_log(options.log, options)
    from wayproof.harness.viewer.movie import check_movie, draw_movie
    from wayproof.harness.viewer.top_view import draw_picture

    began = time.perf_counter()
    log, plugins = options.log, options.allow_plugins
    out: Path = options.movie or options.out or Path(f"{log.stem}-{options.sequence}.png")
    frames = 1
    with console.status("making the maps again"):
        if options.movie:
            check_movie(out, options.period)
            frames = draw_movie(log, out, options.period, plugins)
        else:
            draw_picture(log, options.sequence, out, plugins)
    wall, size = time.perf_counter() - began, out.stat().st_size * 1e-6
    drawn = f"{frames} frames" if options.movie else f"decision {options.sequence}"
    console.print(f"{drawn} in {wall:.1f} s: {out}, {size:.2f} MB", soft_wrap=True, highlight=False)
    return 0, {"out": str(out), "frames": frames, "megabytes": size, "wall_time_s": wall}


def _check(options: argparse.Namespace) -> None:
    if (options.sequence is None) == (options.movie is None):
        raise InputError("expected a decision's number N, or --movie FILE, and not both")
    if options.sequence is not None and options.sequence < 0:
        raise InputError(f"N: got {options.sequence}, expected 0 or more")
    if options.out is not None and options.out.suffix != ".png":
        raise InputError(f"--out: got '{options.out}', expected a name that ends in .png")


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("log", metavar="LOG", type=Path, help="log file")
    parser.add_argument("sequence", metavar="N", type=int, nargs="?", help="number of a decision")
    parser.add_argument(
        "--out", type=Path, metavar="FILE.png", help="image file (default: LOG-N.png)"
    )
    parser.add_argument(
        "--movie", type=Path, metavar="FILE", help="movie of the whole log: a .gif or .mp4"
    )
    parser.add_argument(
        "--period",
        type=float,
        default=0.2,
        metavar="S",
        help="simulated time between frames, s (default: 0.2)",
    )
    add_unchecked(parser)
    add_plugins(parser)


VERB = Verb(
    help="draw the map, the truth and the plans from above: one decision, or a movie",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof picture logs/warehouse-drone-3.mcap 100 --out drone.png",
)
