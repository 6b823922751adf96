"""Checks of options that argparse lacks: repeated options, and unknown ones before missing ones."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator, Sequence

from wayproof.harness.errors import InputError, near_name

NEGATIVE = re.compile(r"-[.\d]")
"""Beginning of a value that argparse takes for an option unless it is a plain number."""


def check_options(parser: argparse.ArgumentParser, arguments: Sequence[str]) -> None:
    """Refuse options that the parser would ignore or report in a confusing way.

    Args:
        parser: Parser of the verb.
        arguments: Words after the verb.

    Raises:
        InputError: An option is unknown; an option or a key of `--set` is given twice; a list of
            numbers that begins with a minus sign follows a space.
    """
    values: dict[str, str] = {}
    for name, value, action in _options(parser, arguments):
        if action is None:
            known = [one for one in parser._option_string_actions if one.startswith("--")]
            near = near_name(name, known)
            hint = f"; did you mean '{near}'?" if near else ""
            raise InputError(f"unknown option '{name}'{hint} (see '{parser.prog} --help')")
        alone = value is not None and value in arguments  # a word of its own, behind a space
        if alone and value and NEGATIVE.match(value) and "," in value and "=" not in value:
            raise InputError(f"{name} {value}: a value with a minus sign is written {name}={value}")
        for once in _given_once(name, value, action):
            if once in values:
                raise InputError(f"{_twice(once)}: given twice, {values[once]} and {value}")
            values[once] = str(value)


def _twice(name: str) -> str:
    if name == "--perturb":
        return "--perturb (exactly one assumption is broken)"
    return name


def _given_once(name: str, value: str | None, action: argparse.Action) -> Iterator[str]:
    """Yield names that may be given only once: the option itself, or the key that it sets."""
    if name == "--set" and value is not None:
        yield f"--set {value.partition('=')[0]}"
    elif type(action).__name__ == "_StoreAction":
        yield name


def _options(
    parser: argparse.ArgumentParser, arguments: Sequence[str]
) -> Iterator[tuple[str, str | None, argparse.Action | None]]:
    """Yield the full name of each long option, its value if there is one, and its action."""
    known = parser._option_string_actions
    for place, word in enumerate(arguments):
        if word == "--":
            return
        if not word.startswith("--"):
            continue
        name, equals, value = word.partition("=")
        full = [name] if name in known else [one for one in known if one.startswith(name)]
        if len(full) > 1:
            continue  # argparse names the candidates
        if not full:
            yield name, None, None
            continue
        after = arguments[place + 1] if place + 1 < len(arguments) else None
        yield full[0], value if equals else after, known[full[0]]
