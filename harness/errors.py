"""Bad input, told in one line."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class InputError(Exception):
    """What the user gave cannot be used; the message is the one line to print, exit code 2.

    What no terminal should be sent, a line break too, stands in it as an escape.
    """

    def __init__(self, message: str) -> None:
        """Take the message, which may quote what a stranger wrote."""
        super().__init__(printable(message))


def printable(text: str) -> str:
    """The text with an escape, as Python writes it, for each control character and line break."""
    return "".join(one if one.isprintable() else ascii(one)[1:-1] for one in text)


def unknown_name(kind: str, got: str, available: Iterable[str]) -> InputError:
    """Build the error for a name that is not in a registry, with the nearest one that is."""
    names = sorted(available)
    close = difflib.get_close_matches(got, names, n=1)
    hint = f"; did you mean '{close[0]}'?" if close else ""
    return InputError(f"unknown {kind} '{got}'{hint} (available: {', '.join(names)})")
