"""Movie of an episode that has just been logged, for `wayproof run --render`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from wayproof.harness.errors import InputError

if TYPE_CHECKING:
    from wayproof.harness.config import Config

PERIOD = 0.2
"""Simulated time between frames, s."""


def check_render(config: Config, out: Path) -> None:
    """Check before the episode that its log can be drawn.

    Raises:
        InputError: The log cannot be drawn on this machine, or not into this file.
    """
    if config.record != "full":
        raise InputError(f"--render: got record={config.record}, expected full: it draws the log")
    from wayproof.harness.viewer.movie import check_movie

    check_movie(out, PERIOD)


def render(log: Path, out: Path, console: Console) -> dict[str, Any]:
    """Draw the whole log and print the name of the movie."""
    from wayproof.harness.viewer.movie import draw_movie

    with console.status("drawing"):
        frames = draw_movie(log, out, PERIOD, allow_plugins=True)  # it has just been run
    size = out.stat().st_size * 1e-6
    console.print(f"movie: {out}, {frames} frames, {size:.2f} MB", soft_wrap=True, highlight=False)
    return {"out": str(out), "frames": frames, "megabytes": size}
