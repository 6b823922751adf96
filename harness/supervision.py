"""Connection of a process that runs a user's code to the parent that finishes its log.

The parent is `harness.cli.parent_process`. In a process without such a parent these functions do
nothing.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import IO, NamedTuple

ENDED = b"ended"
"""Last line of a child to its parent: its work is finished, well or not."""


class _Parent(NamedTuple):
    """Connection of a forked process to its parent.

    Attributes:
        report: Descriptor of the pipe to it.
        stacks: File for the stacks of a process that hangs.
    """

    report: int
    stacks: IO[bytes]


_parent: list[_Parent] = []
"""Set once, in a child, when it is forked."""


def connect(report: int, stacks: IO[bytes]) -> None:
    """Connect this forked process to its parent: a pipe, and a file for its stacks."""
    _parent.append(_Parent(report, stacks))


def announce(log: Path) -> None:
    """Report to the parent which log is being written."""
    for parent in _parent:
        os.write(parent.report, os.fsencode(log.resolve()) + b"\n")


def ended() -> None:
    """Report to the parent that no log is left for it to finish."""
    for parent in _parent:
        os.write(parent.report, ENDED + b"\n")


def bound_memory(mebibytes: int | None) -> None:
    """Bound the memory of a process that was forked off for a user's code; none lifts the bound."""
    if _parent:
        import resource

        hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
        soft = hard if mebibytes is None else mebibytes * 2**20
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))


def stacks_file() -> IO[bytes] | None:
    """Return the file for the stacks of a child that hangs; None without a supervising parent."""
    return _parent[0].stacks if _parent else None
