"""View of an episode while it runs, for `wayproof run --view`, in a process of its own."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from rich.console import Console

LONGEST_S = 120.0
"""Time for the view to catch up with an episode that has ended, s."""


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
