"""Run a command, and end with it whatever it started: also a child that left its session.

A program by itself, of the standard library alone, so that it starts at once on Linux:

    python -I -S keeper.py PARENT COMMAND...

As a subreaper it becomes the parent of every process whose own has ended. It ends as the command
does, at SIGTERM, and with PARENT. What a process of the same user can do, this cannot prevent: one
that stops it first, or that has others started elsewhere, such as by a daemon, outlives it.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from contextlib import suppress
from pathlib import Path
from types import FrameType

PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER = 1, 36

NO_COMMAND = 127
"""Exit code where the command cannot be run, as of a shell."""


class Ending(BaseException):
    """SIGTERM."""


def main(parent: int, words: list[str]) -> int:
    """Run a command; return its status as `os.wait` has it.

    Args:
        parent: Process that this one ends with.
        words: The command.
    """
    prctl = ctypes.CDLL(None).prctl
    prctl(PR_SET_CHILD_SUBREAPER, 1)
    signal.signal(signal.SIGTERM, _end)
    prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:
        return signal.SIGTERM
    command = os.fork()
    if command == 0:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        _become(words)
    for pipe in (0, 1):  # they end with the command
        os.close(pipe)
    try:
        return _status_of(command)
    except Ending:
        return signal.SIGKILL
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        end_children()


def end_children() -> None:
    """Kill all children, and theirs as they become ours."""
    while True:
        for child in children():
            os.kill(child, signal.SIGKILL)
        try:
            os.wait()
        except ChildProcessError:
            return


def children() -> list[int]:
    """Return the children of this process, those that have ended with them."""
    found = []
    for one in Path("/proc").iterdir():
        if not one.name.isdigit():
            continue
        try:
            fields = (one / "stat").read_text(errors="replace").rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == os.getpid():
            found.append(int(one.name))
    return found


def _end(_: int, __: FrameType | None) -> None:
    raise Ending


def _become(words: list[str]) -> None:
    try:
        os.execvp(words[0], words)
    except OSError as error:
        print(f"{words[0]}: {error.strerror}", file=sys.stderr)
        os._exit(NO_COMMAND)


def _status_of(command: int) -> int:
    """Wait for the end of the command; return its status."""
    while True:
        ended, status = os.wait()
        if ended == command:
            return status


if __name__ == "__main__":
    outcome = main(int(sys.argv[1]), sys.argv[2:])
    if os.WIFSIGNALED(outcome):
        with suppress(OSError):  # nobody handles SIGKILL
            signal.signal(os.WTERMSIG(outcome), signal.SIG_DFL)
        os.kill(os.getpid(), os.WTERMSIG(outcome))
    os._exit(os.waitstatus_to_exitcode(outcome))
