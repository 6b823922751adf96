"""TOML of unknown origin."""

from __future__ import annotations

import tomllib
from typing import Any

DEEPEST = 16
"""Most tables and arrays within each other; a spec of a robot has three."""


def parse_toml(text: str) -> dict[str, Any]:
    """Parse a text.

    Raises:
        TOMLDecodeError: It is no TOML, or its tables and arrays are nested too deeply to be walked.
    """
    try:
        document = tomllib.loads(text)
    except RecursionError:
        raise _too_deep() from None
    _check_depth(document, DEEPEST)
    return document


def _check_depth(value: object, left: int) -> None:
    if not isinstance(value, dict | list):
        return
    if left == 0:
        raise _too_deep()
    for one in value.values() if isinstance(value, dict) else value:
        _check_depth(one, left - 1)


def _too_deep() -> tomllib.TOMLDecodeError:
    return tomllib.TOMLDecodeError(f"nested too deeply, expected {DEEPEST} levels at most")
