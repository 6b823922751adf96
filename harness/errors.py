"""Bad input, told in one line."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class InputError(Exception):
    """What the user gave cannot be used; the message is the one line to print, exit code 2."""


def unknown_name(kind: str, got: str, available: Iterable[str]) -> InputError:
    """Build the error for a name that is not in a registry, with the nearest one that is."""
    names = sorted(available)
    close = difflib.get_close_matches(got, names, n=1)
    hint = f"; did you mean '{close[0]}'?" if close else ""
    return InputError(f"unknown {kind} '{got}'{hint} (available: {', '.join(names)})")
