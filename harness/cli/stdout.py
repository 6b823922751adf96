"""Standard output: errors of its own class, and a console that no printed text controls."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Iterable
from typing import Any, TextIO

from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment

from wayproof.harness.errors import printable

BROKEN_PIPE = 141
"""Exit code of a command whose reader has closed the pipe: 128 + SIGPIPE, as in a shell."""


class OutputError(Exception):
    """Standard output cannot be written to."""

    def __init__(self, cause: OSError) -> None:
        """Keep the error of the system."""
        super().__init__(cause.strerror)
        self._cause = cause

    def give_up(self) -> int:
        """Discard further output, and print the reason unless the reader closed the pipe.

        Returns:
            The exit code.
        """
        try:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        except (OSError, ValueError):  # it is closed, or no file
            pass
        if self._cause.errno == errno.EPIPE:
            return BROKEN_PIPE
        print(f"wayproof: standard output: {self._cause.strerror}", file=sys.stderr)
        return 2


class CheckedStdout:
    """Text stream whose `write` and `flush` raise `OutputError` if they fail."""

    def __init__(self, stream: TextIO) -> None:
        """Wrap a stream."""
        self._stream = stream

    def write(self, text: str) -> int:
        """Write a text."""
        return int(self._checked("write", text))

    def flush(self) -> None:
        """Flush the stream."""
        self._checked("flush")

    def _checked(self, method: str, *values: str) -> Any:
        try:
            return getattr(self._stream, method)(*values)
        except OSError as error:
            raise OutputError(error) from None

    def __getattr__(self, name: str) -> Any:
        """Return any other attribute of the stream."""
        return getattr(self._stream, name)


class PlainConsole(Console):
    """Console on which printed text, of whatever origin, does not control the terminal."""

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Render, with control characters escaped but for line breaks and tabs."""
        for segment in super().render(renderable, options):
            text = segment.text
            if not (segment.control or text.isprintable()):
                text = "\n".join(map(_escaped, text.split("\n")))
            yield segment._replace(text=text)


def _escaped(line: str) -> str:
    return "\t".join(map(printable, line.split("\t")))
