"""Parts of docstrings, for generated pages and the catalogue."""

from __future__ import annotations

import inspect
import itertools
import re


def attributes(section: type) -> dict[str, str]:
    """Each attribute's description in a class's docstring, or a base's, as one line."""
    found: dict[str, str] = {}
    for one in section.__mro__[-2::-1]:
        found |= _attributes_of(one)
    return found


def _attributes_of(section: type) -> dict[str, str]:
    _, _, block = inspect.cleandoc(section.__doc__ or "").partition("Attributes:\n")
    found: dict[str, str] = {}
    name = ""
    for line in block.splitlines():
        opened = re.match(r" {4}(\w+): (.*)", line)
        if opened:
            name = opened[1]
            found[name] = opened[2]
        elif line.startswith(" " * 8):
            found[name] += f" {line.strip()}"
        elif line.strip():
            break  # the next section
    return {name: re.sub(r"``(.+?)``", r"`\1`", text) for name, text in found.items()}


def summary(thing: object) -> str:
    """The first paragraph of a docstring, as one line."""
    return " ".join(inspect.cleandoc(thing.__doc__ or "").split("\n\n")[0].split())


def description(thing: object) -> str:
    """All paragraphs of a docstring before its sections, as one line."""
    paragraphs = inspect.cleandoc(thing.__doc__ or "").split("\n\n")
    before = itertools.takewhile(lambda one: not re.match(r"\w+:\n", one), paragraphs)
    return " ".join(" ".join(before).split())
