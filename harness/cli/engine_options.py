"""Options and progress bar of verbs that run many episodes."""

from __future__ import annotations

import argparse
import contextlib
import functools
import os
import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from rich.console import Console

from wayproof.harness.cli.verb import arg, arguments
from wayproof.harness.errors import InputError, unknown_name

if TYPE_CHECKING:
    from wayproof.harness.study.job import Done
    from wayproof.harness.study.study import Engine
    from wayproof.harness.worker_pool import Bounds

ENGINES = ("processes", "ray")

EACH_S = 30.0
"""Time between lines of progress where nobody sees the bar, s."""


add_engine = arguments(
    arg("--jobs N", "number of processes (default: one for each core)", int, os.cpu_count() or 1),
    arg("--engine ENGINE", " or ".join(ENGINES), default="processes"),
    arg("--address HOST:PORT", "address of a running Ray cluster"),
)
"""Options of the engine that runs the episodes."""


def check_engine(options: argparse.Namespace) -> None:
    """Check the options of the engine.

    Raises:
        InputError: The engine is unknown, or does not take these options.
    """
    if options.engine not in ENGINES:
        raise unknown_name("engine", options.engine, ENGINES)
    if options.jobs < 1:
        raise InputError(f"--jobs {options.jobs}: expected at least 1")
    if options.address and options.engine != "ray":
        raise InputError("--address: only --engine ray has one")


@contextlib.contextmanager
def open_engine(options: argparse.Namespace, bounds: Bounds) -> Iterator[Engine]:
    """Open the engine that the options select; its processes end with the block.

    Raises:
        InputError: The engine is unknown, or does not take these options.
    """
    check_engine(options)
    if options.engine == "ray":
        from wayproof.harness.study.cluster import run_on_ray

        yield functools.partial(
            run_on_ray, workers=options.jobs, bounds=bounds, address=options.address
        )
        return
    from wayproof.harness.study.processes import ProcessEngine

    with ProcessEngine(options.jobs, bounds) as engine:
        yield engine


class Watch:
    """Progress bar: episodes done, errors so far, time left."""

    def __init__(self, console: Console, episodes: int | None, missing: int = 0) -> None:
        """Show progress over `episodes` (None if unknown); `missing` remain."""
        from rich.progress import (  # slow to load, and every command reads this module
            BarColumn,
            MofNCompleteColumn,
            Progress,
            TextColumn,
            TimeElapsedColumn,
            TimeRemainingColumn,
        )

        self._errors, self._done, self._missing = 0, 0, missing
        self._next_line = time.monotonic() + EACH_S
        self._progress = Progress(
            TextColumn("{task.description}", style="bold", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=console,
        )
        self._task = self._progress.add_task("episodes", total=episodes)
        self._progress.advance(self._task, 0 if episodes is None else episodes - missing)

    def finished(self, done: Done) -> None:
        """Count an episode that has ended."""
        self._errors += bool(done.error)
        self._done += 1
        text = f"episodes, {self._errors} errors" if self._errors else "episodes"
        self._progress.update(self._task, advance=1, description=text)
        if not self._progress.console.is_terminal and time.monotonic() >= self._next_line:
            self._next_line = time.monotonic() + EACH_S
            of = f" of {self._missing}" if self._missing else ""
            print(f"wayproof: {self._done}{of} {text}", file=sys.stderr, flush=True)

    def __enter__(self) -> Watch:
        """Show the bar."""
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Stop updating the bar."""
        self._progress.stop()
