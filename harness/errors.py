"""Errors of the user's input, in one line each."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class InputError(Exception):
    """The user's input cannot be used; the message is the one line to print, exit code 2.

    Control characters and line breaks are escaped in it.
    """

    def __init__(self, message: str) -> None:
        """Keep the message, which may quote text of unknown origin."""
        super().__init__(printable(message))


def printable(text: str) -> str:
    """Escape each control character and line break of a text, as Python writes it."""
    return "".join(one if one.isprintable() else ascii(one)[1:-1] for one in text)


class Interrupted(KeyboardInterrupt):
    """Ctrl-C, with the state of the work in one line."""


def unknown_name(kind: str, got: str, available: Iterable[str]) -> InputError:
    """Build the error for a name that is not in a registry, with the nearest one that is."""
    names = sorted(available)
    near = near_name(got, names)
    hint = f"; did you mean '{near}'?" if near else ""
    return InputError(f"unknown {kind} '{got}'{hint} (available: {', '.join(names)})")


def near_name(got: str, names: Iterable[str]) -> str | None:
    """Return the nearest name: another case or separator, a misspelling, or a part of it.

    A part has at least three characters and belongs to one name alone.
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


class NeverReturned(BaseException):
    """A decision, or the physics after it, took more wall time than `plugins.wall_s`."""
