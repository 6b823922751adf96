"""A parent for a process that runs a user's code: whatever that does, the log is finished.

Python code can be interrupted (`harness.user_code`). A process that is killed, crashes or hangs in
compiled code can finish nothing. So it is forked off before anything is loaded; its parent waits,
and makes a whole log of what the child had written.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import tempfile
import tomllib
from argparse import Namespace
from pathlib import Path
from typing import IO, NamedTuple

from wayproof.harness.errors import InputError

ENDED = b"ended"
"""Last line that a child writes to its parent: it finished its work, well or not."""


class _Child(NamedTuple):
    """What a forked process has of its parent.

    Attributes:
        report: Pipe to it.
        stacks: File for the stacks of a process that hangs.
    """

    report: int
    stacks: IO[bytes]


_of_parent: list[_Child] = []
"""Set once, in a child, when it is forked."""


def names_user_code(options: Namespace) -> bool:
    """Whether the options of `wayproof run` name a planner or a controller of the user's own."""
    settings = [one.partition("=") for one in options.set]
    if any(key == "planner.name" and ":" in value for key, _, value in settings):
        return True
    with contextlib.suppress(OSError, ValueError):  # bad specs are refused where they are read
        spec = tomllib.loads(Path(options.robot).read_text(encoding="utf-8"))
        return ":" in str(spec.get("controller", ""))
    return False


def supervised() -> int | None:
    """Fork: none in the child, which goes on; in the parent, when it ended, its exit code."""
    read, write = os.pipe()
    with tempfile.TemporaryFile() as stacks:
        child = os.fork()
        if child == 0:
            os.close(read)
            _of_parent.append(_Child(write, os.fdopen(os.dup(stacks.fileno()), "wb")))
            return None
        os.close(write)
        status = _wait(child)
        with os.fdopen(read, "rb") as report:
            *logs, last = report.read().splitlines() or [b""]
        code = os.waitstatus_to_exitcode(status)
        if last == ENDED:
            return code
        stacks.seek(0)
        text = stacks.read(2**16).decode(errors="replace")
    log = Path(os.fsdecode((logs or [last])[-1]))
    return _finish(log, code, text) if log.name else (code if code >= 0 else 128 - code)


def announce(log: Path) -> None:
    """Tell the parent, if there is one, which log is being written."""
    for parent in _of_parent:
        os.write(parent.report, os.fsencode(log.resolve()) + b"\n")


def ended() -> None:
    """Tell the parent, if there is one, that nothing is left for it to finish."""
    for parent in _of_parent:
        os.write(parent.report, ENDED + b"\n")


def bound_memory(mebibytes: int | None) -> None:
    """Bound the memory of a process that was forked off for a user's code; none lifts the bound."""
    if _of_parent:
        import resource

        hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
        soft = hard if mebibytes is None else mebibytes * 2**20
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))


def stacks_file() -> IO[bytes] | None:
    """Where a child that hangs leaves its stacks; none in a process without such a parent."""
    return _of_parent[0].stacks if _of_parent else None


def _wait(child: int) -> int:
    """Wait for the child, which gets the terminal's Ctrl-C itself, and SIGTERM from here."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: os.kill(child, signal.SIGTERM))
    return os.waitpid(child, 0)[1]


def _finish(log: Path, code: int, stacks: str) -> int:
    """Make a whole log of what the child left, and say so; exit code 1."""
    from wayproof.harness.log.recover import finish_partial

    how = f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
    if stacks:
        how = "did not return, and could not be interrupted (plugins.wall_s)"
    partial = log.with_name(f"{log.name}.partial")
    try:
        reason, _ = finish_partial(partial, log, how, stacks)
    except InputError as error:
        print(f"wayproof: a user's code: the process {how}; {error}", file=sys.stderr)
        return 1
    print(f"{stacks}wayproof: error: {reason}", file=sys.stderr)
    print(f"explain: wayproof explain {log} --allow-plugins\nlog: {log}")
    return 1
