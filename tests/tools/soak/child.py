"""Forked child process with all kernels compiled, watched, and killed on request."""

from __future__ import annotations

import os
import select
import signal
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

MEMORY = Path("/dev/shm")

TAIL = 4000  # last bytes of a traceback that are reported


def scratch() -> Path | None:
    """Return the folder for short-lived logs: a file system in memory if there is one."""
    return MEMORY if os.access(MEMORY, os.W_OK) else None


@dataclass(frozen=True)
class Kill:
    """Time at which a child is killed: a delay after some lines of its output.

    Wall time alone would depend on the load of the machine.
    """

    lines: int
    then_s: float


@dataclass(frozen=True)
class Ended:
    """End of a child."""

    code: int
    lines: tuple[str, ...]
    overdue: bool
    peak_mib: float
    cpu_s: float


def in_child(
    work: Callable[[Callable[[str], None]], None], silence_s: float, kill: Kill | None = None
) -> Ended:
    """Run a function in a forked child, which is killed after so much silence, s."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        _work(work, reading, writing)
    os.close(writing)
    text, overdue = _listen(reading, child, silence_s, kill)
    os.close(reading)
    _, status, usage = os.wait4(child, 0)
    lines = tuple(text.decode(errors="replace").splitlines())
    peak_mib, cpu_s = usage.ru_maxrss / 1024, usage.ru_utime + usage.ru_stime
    return Ended(os.waitstatus_to_exitcode(status), lines, overdue, peak_mib, cpu_s)


def _work(work: Callable[[Callable[[str], None]], None], reading: int, writing: int) -> None:
    os.close(reading)

    def report(line: str) -> None:
        os.write(writing, f"{line}\n".encode())

    code = 0
    try:
        work(report)
    except BaseException:
        report("traceback: " + " | ".join(traceback.format_exc().splitlines())[-TAIL:])
        code = 1
    sys.stdout.flush()
    os._exit(code)


def _listen(reading: int, child: int, silence_s: float, kill: Kill | None) -> tuple[bytes, bool]:
    text = b""
    last = time.monotonic()
    kill_at = last + kill.then_s if kill is not None and kill.lines == 0 else None
    while True:
        now = time.monotonic()
        wait = last + silence_s - now
        if kill_at is not None:
            wait = min(wait, kill_at - now)
        ready, _, _ = select.select([reading], [], [], max(wait, 0.0))
        now = time.monotonic()
        if ready:
            piece = os.read(reading, 65536)
            if not piece:
                return text, False
            before, after = text.count(b"\n"), (text + piece).count(b"\n")
            if kill is not None and before < kill.lines <= after:
                kill_at = now + kill.then_s
            text, last = text + piece, now
        if kill_at is not None and now >= kill_at:
            os.kill(child, signal.SIGKILL)
            kill_at = None
        elif now - last >= silence_s:
            os.kill(child, signal.SIGKILL)
            return text, True
