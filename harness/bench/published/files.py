"""What a published benchmark is given: where its files lie, and where logs go."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from wayproof.harness.errors import InputError


class Files(NamedTuple):
    """Paths that the user gave.

    Attributes:
        option: The option that named them.
        path: A file or a folder, as the option says.
        logs: Folder for the logs of episodes.
    """

    option: str
    path: Path
    logs: Path


Progress = Callable[[str], None]


def files_named(folder: Path, pattern: str) -> list[Path]:
    """The files of a folder that fit a pattern, by name, numbers in their order.

    Raises:
        InputError: No such folder, or nothing in it that fits.
    """
    if not folder.is_dir():
        raise InputError(f"--worlds: no folder '{folder}'")
    found = sorted(folder.glob(pattern), key=lambda path: (len(path.name), path.name))
    if not found:
        raise InputError(f"--worlds: no '{pattern}' in '{folder}'")
    return found
