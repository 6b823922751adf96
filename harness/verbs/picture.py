"""`wayproof picture`: the simulated scene with the map laid over it, as PNG or GIF."""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

from rich.console import Console

from harness.errors import InputError
from harness.verbs.verb import Document, Verb

LEAST_PERIOD = 0.02
"""Of an animation, s: viewers play no GIF faster."""


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Draw one decision, or all of them."""
    _check(options)
    if sys.platform == "linux" and not os.environ.get("DISPLAY"):
        os.environ.setdefault("MUJOCO_GL", "egl")  # before the simulator is loaded
    from harness.viewer.picture import draw_animation, draw_picture

    began = time.perf_counter()
    log, plugins = options.log, options.allow_plugins
    out: Path = options.gif or options.out or Path(f"{log.stem}-{options.sequence}.png")
    frames = 1
    with console.status("making the maps again"):
        if options.gif:
            frames = draw_animation(log, out, options.period, plugins)
        else:
            draw_picture(log, options.sequence, out, plugins)
    wall, size = time.perf_counter() - began, out.stat().st_size * 1e-6
    told = f"{frames} frames" if options.gif else f"decision {options.sequence}"
    console.print(f"{told} in {wall:.1f} s: {out}, {size:.2f} MB", soft_wrap=True, highlight=False)
    return 0, {"out": str(out), "frames": frames, "megabytes": size, "wall_time_s": wall}


def _check(options: argparse.Namespace) -> None:
    if (options.sequence is None) == (options.gif is None):
        raise InputError("expected a decision's number N, or --gif FILE.gif, and not both")
    if options.sequence is not None and options.sequence < 0:
        raise InputError(f"N: got {options.sequence}, expected 0 or more")
    for name, ending in (("out", ".png"), ("gif", ".gif")):
        path = getattr(options, name)
        if path is not None and path.suffix != ending:
            raise InputError(f"--{name}: got '{path}', expected a name that ends in {ending}")
    if not LEAST_PERIOD <= options.period <= 60.0:
        raise InputError(f"--period: got {options.period:g}, expected {LEAST_PERIOD:g} to 60 s")


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("log", metavar="LOG", type=Path)
    parser.add_argument("sequence", metavar="N", type=int, nargs="?", help="a decision's number")
    parser.add_argument("--out", type=Path, metavar="FILE.png", help="default: LOG-N.png")
    parser.add_argument("--gif", type=Path, metavar="FILE.gif", help="the whole log, animated")
    parser.add_argument(
        "--period", type=float, default=0.2, metavar="S", help="between frames, s (default: 0.2)"
    )
    parser.add_argument(
        "--allow-plugins",
        action="store_true",
        help="import the planner that a log names as module:Class",
    )


VERB = Verb(
    help="the simulated scene with the map laid over it, one decision or an animation",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof picture logs/warehouse-drone-3.mcap 100 --out drone.png",
)
