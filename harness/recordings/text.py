"""Small text files of a recording: bounded, in lines of words."""

from __future__ import annotations

from collections.abc import Iterator
from decimal import Decimal
from pathlib import Path

from wayproof.harness.errors import InputError

MOST_BYTES = 2**28
MOST_STAMP_S = 9_000_000_000
"""Greatest stamp, s: that of 64 bits of nanoseconds."""


def nanoseconds(word: str) -> int:
    """Return a number of seconds as nanoseconds, exactly.

    Raises:
        ValueError, ArithmeticError: It is no number, or more than 64 bits hold.
    """
    seconds = Decimal(word)
    if not abs(seconds) < MOST_STAMP_S:
        raise ValueError(word)
    return int((seconds * 10**9).to_integral_value())


def rows(path: Path, most: int = MOST_BYTES) -> Iterator[list[str]]:
    """Yield the words of each line of a text file; `#` begins a comment.

    Raises:
        InputError: No such file, or over a number of bytes.
    """
    try:
        if path.stat().st_size > most:
            raise InputError(f"recording '{path}': over {most} bytes")
        with path.open(encoding="utf-8", errors="replace") as file:
            for line in file:
                words = line.partition("#")[0].split()
                if words:
                    yield words
    except OSError as error:
        raise InputError(f"recording '{path}': {error.strerror}") from None


def beside(folder: Path, name: str) -> Path:
    """Return a file that a text names, which has to lie in the folder or below.

    Raises:
        ValueError: The name leads out of it.
    """
    found = (folder / name).resolve()
    if not found.is_relative_to(folder.resolve()):
        raise ValueError(name)
    return found
