"""TOML of unknown origin."""

from __future__ import annotations

import re
import tomllib
from typing import Any

DEEPEST = 16
"""Most tables and arrays within each other; a spec of a robot has three."""

LONG_KEY = re.compile(rf"(?:[\w-]+\s*\.\s*){{{DEEPEST}}}")
"""Dotted key as deep, whose reading takes time by the cube of its length."""


def parse_toml(text: str) -> dict[str, Any]:
    """Parse a text.

    Raises:
        TOMLDecodeError: It is no TOML, or its tables and arrays are nested too deeply to be walked.
    """
    if LONG_KEY.search(text):
        raise _too_deep()
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
