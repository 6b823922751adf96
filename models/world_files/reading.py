"""Reading of foreign files: bounded sizes, and errors that name the place."""

from __future__ import annotations

from pathlib import Path

MAX_BYTES = 256 * 2**20
"""Maximum size of a file, bytes, checked before it is read."""

MAX_CELLS = 2**28
"""Maximum number of cells of a grid."""

MAX_HEIGHTS = 2**21
"""Maximum number of heights in a world, which holds each as a number in text."""

MAX_SOLIDS = 200_000
"""Maximum number of solids in a world; more take minutes to compile."""


FARTHEST = 1e5
"""Greatest coordinate of a solid, m."""


class WorldFileError(ValueError):
    """A file cannot be taken for a world; the message names the file, and the line if known."""

    def __init__(self, path: Path | str, what: str, line: int | None = None) -> None:
        """Give file, line and fault in one line."""
        place = f"{path}" if line is None else f"{path}:{line}"
        super().__init__(f"{place}: {what}")


def check_file(path: Path, most: int = MAX_BYTES) -> None:
    """Refuse a path that is no file, an empty file and a huge one.

    Raises:
        WorldFileError: Saying which.
    """
    if not path.is_file():
        raise WorldFileError(path, "no such file")
    size = path.stat().st_size
    if size == 0:
        raise WorldFileError(path, "empty file")
    if size > most:
        raise WorldFileError(path, f"{size} bytes, expected at most {most}")


def read_text(path: Path, most: int = MAX_BYTES) -> str:
    """Read a whole text file.

    Raises:
        WorldFileError: No such file, empty, too large, or no UTF-8.
    """
    check_file(path, most)
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise WorldFileError(
            path, f"no UTF-8 text (byte {error.start}); iconv makes it one"
        ) from None


def beside(path: Path, name: str) -> Path:
    """Return a file that another one names, which has to lie in its folder or below.

    Raises:
        WorldFileError: The name leads out of the folder.
    """
    folder = path.parent.resolve()
    found = (folder / name).resolve()
    if not found.is_relative_to(folder):
        raise WorldFileError(path, f"'{name}' lies outside the file's folder")
    return found
