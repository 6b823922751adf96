"""Input files of a published benchmark, the stack that runs it, and the folder of its logs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

from wayproof.harness.config import BUILTIN, StackConfig
from wayproof.harness.errors import InputError


class Files(NamedTuple):
    """Paths and stack given on the command line.

    Attributes:
        option: Option that named the path.
        path: File or folder, depending on the option.
        logs: Folder for the logs of episodes.
        stack: Stack that drives in the episodes.
    """

    option: str
    path: Path
    logs: Path
    stack: StackConfig = StackConfig()

    def log_folder(self, benchmark: str) -> Path:
        """Return the folder for the logs of a benchmark, one for each stack."""
        parts = [benchmark]
        if self.stack.name != BUILTIN:
            parts.append(re.sub(r"[^A-Za-z0-9_.]+", "-", self.stack.name)[:60])
        if self.stack.guard:
            parts.append("guard")
        return self.logs / "-".join(parts)


def files_named(folder: Path, pattern: str) -> list[Path]:
    """Return the files of a folder that match a pattern, sorted by name, numbers by value.

    Raises:
        InputError: There is no such folder, or no match in it.
    """
    if not folder.is_dir():
        raise InputError(f"--worlds: no folder '{folder}'")
    found = sorted(folder.glob(pattern), key=lambda path: (len(path.name), path.name))
    if not found:
        raise InputError(f"--worlds: no '{pattern}' in '{folder}'")
    return found
