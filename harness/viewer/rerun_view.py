"""Display of logs in a Rerun viewer, or recording to a file for it."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from wayproof.harness.errors import InputError
from wayproof.harness.log.follow import FollowedLog, followed, partial_name
from wayproof.harness.log.reader import Log, open_log
from wayproof.harness.log.writer import check_folder
from wayproof.harness.outputs import check_target, written_whole
from wayproof.harness.viewer.ahead import Ahead
from wayproof.harness.viewer.snapshots import snapshots

if TYPE_CHECKING:
    import rerun as rr

    from wayproof.harness.shadow.legs import Leg

ROOTS = ("log", "other")

ENDING = ".rrd"
"""Suffix of a recording for Rerun."""

SNAPSHOTS_AHEAD = 128
"""Number of prefetched snapshots: those made while Rerun is imported, some 10 MB."""

TURN = 1e-3
"""Switch interval of Python's threads, s. The kernels of a map take less than the default of 5 ms,
which they would wait after each; shorter intervals cost more than they gain."""

LONGEST_FLUSH = 30.0
"""Timeout for a viewer or a disk to take all data, s."""


@dataclass(frozen=True)
class View:
    """Summary of a display.

    Attributes:
        logs: Paths of the logs.
        decisions: Number of decisions of each.
        saved: Path of the recording; None if a viewer was opened.
        megabytes: Its size, MB.
        wall_time_s: Wall time, s.
    """

    logs: tuple[str, ...]
    decisions: tuple[int, ...]
    saved: str | None
    megabytes: float | None
    wall_time_s: float


def view(paths: Sequence[Path], saved: Path | None = None, allow_plugins: bool = False) -> View:
    """Show one log, or two side by side on one timeline.

    Args:
        paths: Paths of the logs.
        saved: Path of the recording; None to open a viewer.
        allow_plugins: Whether code that a log's config names may be imported.

    Raises:
        InputError: A log cannot be read, or its sweeps were left out; there is no display, or the
            file cannot be written.
    """
    began = time.perf_counter()
    logs = dict(zip(ROOTS, (open_log(path, allow_plugins) for path in paths), strict=False))
    check_view(saved)
    legs = {root: _legs(log, allow_plugins) for root, log in logs.items()}
    return _view(logs, saved, began, legs)


def view_live(path: Path, saved: Path | None = None, allow_plugins: bool = False) -> View:
    """Show a log while it is being written, and its result when it is finished.

    What is shown is up to a second of simulated time behind, see `harness.log.follow`. A log that
    is finished already is shown whole.

    Args:
        path: Path of the log, with or without `.partial`.
        saved: Path of the recording; None to open a viewer.
        allow_plugins: Whether code that its config names may be imported.

    Raises:
        InputError: No log of that name is being written; otherwise as `view`.
    """
    began = time.perf_counter()
    check_view(saved)
    if not partial_name(path).exists() and path.is_file():
        return view([path], saved, allow_plugins)
    with followed(path, allow_plugins) as log:
        return _view({ROOTS[0]: log}, saved, began, {})


def check_view(saved: Path | None) -> None:
    """Check that a view can be opened or saved, before the work for it.

    Raises:
        InputError: There is no display, or the file cannot be written.
    """
    if saved is None:
        displays = ("DISPLAY", "WAYLAND_DISPLAY")
        if sys.platform == "linux" and not any(os.environ.get(name) for name in displays):
            raise InputError("no display here: --save FILE.rrd writes what 'rerun FILE.rrd' opens")
        return
    if saved.suffix != ENDING:
        raise InputError(f"view '{saved}': expected a name that ends in {ENDING}")
    check_target(saved, "view")
    check_folder(saved.parent)


def _legs(log: Log, allow_plugins: bool) -> Sequence[Leg]:
    """Return the way of a recorded robot with its verdicts; empty for an episode."""
    if log.config.recording is None:
        return ()
    from wayproof.harness.shadow.assess import assess

    return assess(log.path, allow_plugins).legs


def _view(
    logs: Mapping[str, Log],
    saved: Path | None,
    began: float,
    legs: Mapping[str, Sequence[Leg]],
) -> View:
    """Send all snapshots to a file or a viewer."""
    with ExitStack() as stack:
        stack.enter_context(_brief_turns())
        coming = {
            root: stack.enter_context(closing(Ahead(snapshots(log), SNAPSHOTS_AHEAD)))
            for root, log in logs.items()
        }
        stack.callback(_stop_waiting, logs)
        import rerun as rr  # takes a while; the first maps are made meanwhile

        from wayproof.harness.viewer.layout import layout
        from wayproof.harness.viewer.rerun_log import show_log

        name = " ".join(log.path.stem for log in logs.values())
        stream = rr.RecordingStream("wayproof", recording_id=name)
        if saved is None:
            viewer = loopback_viewer(Path(stack.enter_context(TemporaryDirectory())))
            rr.spawn(executable_path=str(viewer), default_blueprint=layout(logs), recording=stream)
        else:
            partial = stack.enter_context(written_whole(saved, "--save"))
            stream.save(partial, default_blueprint=layout(logs))
        stack.callback(stream.disconnect)
        decisions = tuple(
            show_log(stream, log, coming[root], root, legs.get(root, ()))
            for root, log in logs.items()
        )
        _flush(stream)
    return View(
        logs=tuple(str(log.path) for log in logs.values()),
        decisions=decisions,
        saved=None if saved is None else str(saved),
        megabytes=None if saved is None else saved.stat().st_size * 1e-6,
        wall_time_s=time.perf_counter() - began,
    )


def _stop_waiting(logs: Mapping[str, Log]) -> None:
    """Let the threads that wait for a log's next decision end."""
    for log in logs.values():
        if isinstance(log, FollowedLog):
            log.stop.set()


@contextmanager
def _brief_turns() -> Iterator[None]:
    before = sys.getswitchinterval()
    sys.setswitchinterval(TURN)
    try:
        yield
    finally:
        sys.setswitchinterval(before)


def _flush(stream: rr.RecordingStream) -> None:
    try:
        stream.flush(timeout_sec=LONGEST_FLUSH)
    except Exception as error:  # Rerun's own type is not public
        line = " ".join(str(error).split())[:200]
        raise InputError(f"the viewer does not take the recording: {line}") from None


def loopback_viewer(folder: Path) -> Path:
    """Write a command that starts Rerun's viewer listening on the loopback interface only.

    The viewer listens on every interface by default, and its spawn function has no option for that.
    """
    found = shutil.which("rerun") or str(Path(sys.executable).with_name("rerun"))
    start = folder / "rerun"
    start.write_text(f'#!/bin/sh\nexec {shlex.quote(found)} --bind 127.0.0.1 "$@"\n')
    start.chmod(0o700)
    return start
