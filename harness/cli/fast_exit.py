"""Exit of a process without freeing its objects one by one.

With the modules that an episode needs that takes as long as a tenth of a short command.
"""

from __future__ import annotations

import argparse
import atexit
import contextlib
import os
import sys

from wayproof.harness.cli.parent_process import names_user_code

READING_VERBS = ("audit", "explain", "replay", "verify")


class FastExit:
    """The last exit handler of a process.

    Attributes:
        allowed: Whether the process ran no code of the user's.
        code: Exit code; None where the interpreter shall finish as usual.
    """

    def __init__(self) -> None:
        """Register the handler: handlers run in reverse, so those registered later run before."""
        self.allowed = False
        self.code: int | None = None
        atexit.register(self._exit)

    def _exit(self) -> None:
        if self.code is None:
            return
        with contextlib.suppress(OSError, ValueError):  # closed, or its reader went away
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(self.code)


def runs_only_our_code(options: argparse.Namespace) -> bool:
    """Return whether a command reads logs, or runs an episode, without any code of the user's.

    A user's open files are flushed and objects finalized as the interpreter finishes.
    """
    if getattr(options, "allow_plugins", False) or getattr(options, "stack", None):
        return False
    verb = options.verb.partition(" ")[0]
    return verb in READING_VERBS or (options.verb == "run" and not names_user_code(options))
