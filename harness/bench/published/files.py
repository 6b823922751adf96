"""Input files of a published benchmark, and the folder of its logs."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from wayproof.harness.errors import InputError


class Files(NamedTuple):
    """Paths given on the command line.

    Attributes:
        option: Option that named the path.
        path: File or folder, depending on the option.
        logs: Folder for the logs of episodes.
    """

    option: str
    path: Path
    logs: Path


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
