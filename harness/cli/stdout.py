"""Standard output whose errors are told apart from those of files."""

from __future__ import annotations

import errno
import os
import sys
from typing import Any, TextIO

BROKEN_PIPE = 141
"""Exit code of a command whose reader went away, as a shell has it: 128 and SIGPIPE."""


class OutputError(Exception):
    """Standard output takes no more."""

    def __init__(self, cause: OSError) -> None:
        """Keep what the system said."""
        super().__init__(cause.strerror)
        self._cause = cause

    def give_up(self) -> int:
        """Let nothing more be written; say why, unless the reader only had enough.

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
    """A text stream whose failures to write are `OutputError`; else it is the stream itself."""

    def __init__(self, stream: TextIO) -> None:
        """Wrap a stream."""
        self._stream = stream

    def write(self, text: str) -> int:
        """Write a text.

        Raises:
            OutputError: It cannot be written.
        """
        try:
            return self._stream.write(text)
        except OSError as error:
            raise OutputError(error) from None

    def flush(self) -> None:
        """Hand on what was written.

        Raises:
            OutputError: It cannot be.
        """
        try:
            self._stream.flush()
        except OSError as error:
            raise OutputError(error) from None

    def __getattr__(self, name: str) -> Any:
        """Anything else of the stream."""
        return getattr(self._stream, name)
