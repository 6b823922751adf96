"""Parent of a process that runs a user's code: it finishes the log if that process fails.

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
from argparse import Namespace
from pathlib import Path

from wayproof.harness.errors import InputError
from wayproof.harness.supervision import ENDED, connect
from wayproof.models.toml_text import parse_toml

OTHER_PROCESSES = ("exec:", "unix:", "tcp:", "ros2:")
"""Beginnings of names of stacks that run in a process of their own."""


def names_user_code(options: Namespace) -> bool:
    """Return whether `wayproof run` loads a planner, stack, policy or controller of the user."""
    settings = [one.partition("=") for one in options.set]
    if any(key == "planner.name" and ":" in value for key, _, value in settings):
        return True
    stacks = [options.stack or "", *(value for key, _, value in settings if key == "stack.name")]
    if any(":" in name and not name.startswith(OTHER_PROCESSES) for name in stacks):
        return True
    with contextlib.suppress(OSError, ValueError):  # bad specs are refused where they are read
        spec = parse_toml(Path(options.robot).read_text(encoding="utf-8"))
        return ":" in str(spec.get("controller", ""))
    return False


def fork_child() -> int | None:
    """Fork; return None in the child, and the exit code in the parent when the child has ended."""
    read, write = os.pipe()
    with tempfile.TemporaryFile() as stacks:
        child = os.fork()
        if child == 0:
            os.close(read)
            connect(write, os.fdopen(os.dup(stacks.fileno()), "wb"))
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


def _wait(child: int) -> int:
    """Wait for the child, which gets the terminal's Ctrl-C itself, and SIGTERM from here."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: os.kill(child, signal.SIGTERM))
    return os.waitpid(child, 0)[1]


def _finish(log: Path, code: int, stacks: str) -> int:
    """Make a whole log of the child's partial one, and print so; exit code 1."""
    from wayproof.harness.interface.errors import PLUGIN_FAILED
    from wayproof.harness.log.recover import finish_partial

    how = f"was ended by {signal.Signals(-code).name}" if code < 0 else f"ended with code {code}"
    if stacks:
        how = "did not return, and could not be interrupted (plugins.wall_s)"
    partial = log.with_name(f"{log.name}.partial")
    try:
        reason, _ = finish_partial(partial, log, how, stacks, PLUGIN_FAILED)
    except InputError as error:
        print(f"wayproof: a user's code: the process {how}; {error}", file=sys.stderr)
        return 1
    print(f"{stacks}wayproof: error: {reason}", file=sys.stderr)
    print(f"explain: wayproof explain {log} --allow-plugins\nlog: {log}")
    return 1
