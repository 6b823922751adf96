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


class Interrupted(KeyboardInterrupt):
    """Ctrl-C, with what became of the work in one line."""


def unknown_name(kind: str, got: str, available: Iterable[str]) -> InputError:
    """Build the error for a name that is not in a registry, with the nearest one that is."""
    names = sorted(available)
    near = near_name(got, names)
    hint = f"; did you mean '{near}'?" if near else ""
    return InputError(f"unknown {kind} '{got}'{hint} (available: {', '.join(names)})")


def near_name(got: str, names: Iterable[str]) -> str | None:
    """The name that was probably meant: letters apart in case or separators, or misspelt, or part.

    A part has to be of three characters, and of one name alone.
    """
    plain = {_plain(name): name for name in names}
    word = _plain(got)
    if word in plain:
        return plain[word]
    close = difflib.get_close_matches(word, plain, n=1)
    if close:
        return plain[close[0]]
    within = [name for text, name in plain.items() if len(word) >= 3 and word in text]
    within += [name for text, name in plain.items() if len(text) >= 3 and text in word]
    return within[0] if len(within) == 1 else None


def _plain(name: str) -> str:
    return "".join(one for one in name.lower() if one.isalnum() or one in ".:")
