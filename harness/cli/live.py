"""Live line on the console of a running episode, and its view in a process of its own."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.text import Text

from wayproof.harness.recompute.moments import Moment
from wayproof.harness.schema import wayproof_pb2 as pb

ACTION_STYLES = {
    "follow": "green",
    "explore": "cyan",
    "slow": "yellow",
    "stop_and_wait": "red",
    "recover": "magenta",
    "goal": "bold green",
    "abort": "bold red",
}


LONGEST_S = 120.0
"""Time for the view to catch up with an episode that has ended, s."""


class LiveLine:
    """Line that is rewritten at each decision; a context manager.

    Attributes:
        decisions: Number of decisions shown.
    """

    def __init__(self, console: Console, title: str) -> None:
        """Set the title of the episode."""
        self._title = title
        self._console = console
        self.decisions = 0
        self._live = Live(console=console, refresh_per_second=10)

    def __call__(self, decision: pb.Decision, truth: pb.Truth | pb.RecordedMotion) -> None:
        """Show a decision; the line appears with the first one."""
        self.decisions += 1
        self._live.start()
        stages = decision.stages
        latency = stages.sense_ms + stages.map_ms + stages.costmap_ms + stages.plan_ms
        speed = float(np.linalg.norm(truth.velocity))
        self._live.update(
            Text.assemble(
                (f"{self._title} ", "bold"),
                f"{decision.timestamp.ToNanoseconds() * 1e-9:5.1f} s {speed:4.2f} m/s ",
                (f"{decision.action:<13}", ACTION_STYLES[decision.action]),
                f" {decision.path_length_m:5.1f} m to go"
                if len(decision.global_path)
                else " no path",
                f" {latency:4.0f} ms map {decision.map_version[:8]}",  # cut off first
                no_wrap=True,
                overflow="ellipsis",
            )
        )

    def observe(self, moment: Moment) -> None:
        """Show a decision of an episode."""
        assert moment.truth is not None
        self(moment.decision, moment.truth)

    def __enter__(self) -> LiveLine:
        """Return the line; it appears with the first decision."""
        return self

    def __exit__(self, *_: object) -> None:
        """Stop updating; the last state of the line remains."""
        if not self._live.is_started:
            return
        self._live.stop()
        if not self._console.is_terminal:  # there the last state is printed without its newline
            self._console.line()


@contextlib.contextmanager
def live_view(log: Path, saved: Path | None, console: Console) -> Iterator[None]:
    """Show a log while the block writes it, and wait until all of it is shown.

    It reads the log alone, so the episode does not depend on it, and it ends by itself once nobody
    writes the log.

    Args:
        log: Name of the log; its partial file exists.
        saved: Recording to write; None to open a viewer.
        console: Console for a line at the end.
    """
    command = [sys.executable, "-m", "wayproof", "view", str(log), "--live", "--allow-plugins"]
    if saved is not None:
        command += ["--save", str(saved)]
    process = subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, start_new_session=True
    )
    try:
        yield
    finally:
        with console.status("showing the rest"):
            code = _end_of(process)
    if code == 0:
        where = "in the viewer" if saved is None else str(saved)
        console.print(f"view: {where}")
    else:
        print(f"wayproof: warning: the view ended with code {code}", file=sys.stderr)


def _end_of(process: subprocess.Popen[bytes]) -> int:
    try:
        return process.wait(LONGEST_S)
    except (subprocess.TimeoutExpired, KeyboardInterrupt):
        process.terminate()
        return process.wait()
