"""A child process with everything compiled already: forked, watched, and killed when told to."""

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

TAIL = 4000  # of what a child said last, bytes


def scratch() -> Path | None:
    """Where short-lived logs go: a file system in memory where there is one, for its speed."""
    return MEMORY if os.access(MEMORY, os.W_OK) else None


@dataclass(frozen=True)
class Kill:
    """When a child is to be killed: a moment after it has told so much.

    A moment of wall time alone would come before everything, or after it, whenever the machine
    does other things besides.

    Attributes:
        lines: Told before it; 0 is the start.
        then_s: From there on.
    """

    lines: int
    then_s: float


@dataclass(frozen=True)
class Ended:
    """How a child ended.

    Attributes:
        code: Its exit code; negative is the signal that ended it.
        lines: What it told, line by line; the last one may be cut short by a kill.
        overdue: Whether it was ended because it told nothing for too long.
        peak_mib: Greatest resident memory.
        cpu_s: Processor time.
    """

    code: int
    lines: tuple[str, ...]
    overdue: bool
    peak_mib: float
    cpu_s: float


def in_child(
    work: Callable[[Callable[[str], None]], None],
    silence_s: float,
    kill: Kill | None = None,
) -> Ended:
    """Do something in a forked child.

    Args:
        work: What to do; it is given a function that tells the parent one line.
        silence_s: The child is ended when it has told nothing for so long.
        kill: When it gets SIGKILL, if at all.
    """
    return listen(*start_child(work), silence_s, kill)


def start_child(work: Callable[[Callable[[str], None]], None]) -> tuple[int, int]:
    """Fork a child that does something; its process number, and where to read what it tells."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        _work(work, reading, writing)
    os.close(writing)
    return child, reading


def listen(child: int, reading: int, silence_s: float, kill: Kill | None = None) -> Ended:
    """What a child tells until it ends, and how it ended; arguments as for `in_child`."""
    text, overdue = _listen(reading, child, silence_s, kill)
    os.close(reading)
    _, status, usage = os.wait4(child, 0)
    lines = tuple(text.decode(errors="replace").splitlines())
    peak_mib, cpu_s = usage.ru_maxrss / 1024, usage.ru_utime + usage.ru_stime
    return Ended(os.waitstatus_to_exitcode(status), lines, overdue, peak_mib, cpu_s)


def _work(work: Callable[[Callable[[str], None]], None], reading: int, writing: int) -> None:
    os.close(reading)

    def tell(line: str) -> None:
        os.write(writing, f"{line}\n".encode())

    code = 0
    try:
        work(tell)
    except BaseException:
        tell("traceback: " + " | ".join(traceback.format_exc().splitlines())[-TAIL:])
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
