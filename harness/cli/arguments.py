"""Checks that argparse lacks: options given twice or unknown, and paths that cannot be used."""

from __future__ import annotations

import argparse
import contextlib
import errno
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from wayproof.harness.errors import InputError, near_name

NEGATIVE = re.compile(r"-[.\d]")
"""Beginning of a value that argparse takes for an option unless it is a plain number."""

UNUSABLE_PATH = (
    *(errno.EACCES, errno.EPERM, errno.EROFS),
    *(errno.EISDIR, errno.ENAMETOOLONG, errno.ENOTDIR, errno.ENOENT),
)
"""Errors of the system that are due to the path of a file."""


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


@contextlib.contextmanager
def refusing_unusable_paths(arguments: Sequence[str]) -> Iterator[None]:
    """Raise `InputError` where the system refuses a path that the words of a command name.

    Such are a file that may not be read and a name that is too long, wherever it is opened.
    """
    try:
        yield
    except OSError as error:
        if error.errno in UNUSABLE_PATH and _is_named(error.filename, arguments):
            raise InputError(f"'{error.filename}': {error.strerror}") from None
        raise


def _is_named(path: object, arguments: Sequence[str]) -> bool:
    """Return whether a word of the command names a path, one that holds it, or one in it."""
    if not isinstance(path, str):
        return False
    named = [Path(word.rpartition("=")[2]) for word in arguments]
    if any(Path(path) in one.parents for one in named):
        return True
    parts = {name for part in Path(path).parts for name in (part, Path(part).stem)}
    return not parts.isdisjoint(one.name for one in named)


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
