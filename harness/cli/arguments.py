"""Parser of arguments whose errors are one line, and refusal of paths that cannot be used."""

from __future__ import annotations

import argparse
import contextlib
import errno
import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NoReturn

from wayproof.harness.errors import InputError, near_name

UNUSABLE_PATH = (
    *(errno.EACCES, errno.EPERM, errno.EROFS),
    *(errno.EISDIR, errno.ENAMETOOLONG, errno.ENOTDIR, errno.ENOENT),
)
"""Errors of the system that are due to the path of a file."""

ONE_VALUE = "expected one argument"
"""End of argparse's message where a value is missing or looks like an option."""


class Parser(argparse.ArgumentParser):
    """Argument parser that raises `InputError`, also for an option that is given twice."""

    def __init__(self, **settings: Any) -> None:
        """Take the settings of an `ArgumentParser`; texts keep their line breaks."""
        super().__init__(formatter_class=argparse.RawDescriptionHelpFormatter, **settings)
        for action in (None, "store"):
            self.register("action", action, _Once)

    def parse(self, words: Sequence[str], verb: str) -> argparse.Namespace:
        """Return the options that the words after a verb give, and the name of the verb.

        Raises:
            InputError: They cannot be used.
        """
        known = [one for one in self._option_string_actions if one.startswith("--")]
        for word in itertools.takewhile("--".__ne__, words):
            name = word.partition("=")[0]
            if name.startswith("--") and not any(one.startswith(name) for one in known):
                near = near_name(name, known)
                hint = f"; did you mean '{near}'?" if near else ""
                self.error(f"unknown option '{name}'{hint}")
        options = self.parse_args(words, argparse.Namespace(verb=verb))
        self._refuse_useless(options)
        return options

    def _refuse_useless(self, options: argparse.Namespace) -> None:
        """Refuse an option that was given without any of those that it goes with."""
        given = options.__dict__.setdefault("given", set())
        given |= {name for name, value in vars(options).items() if value is True}
        for action in self._actions:
            needs = getattr(action, "needs", ())
            known = {self._option_string_actions[name].dest for name in needs}
            if needs and action.dest in given and given.isdisjoint(known):
                self.error(f"{action.option_strings[0]}: goes with {' or '.join(needs)}")

    def error(self, message: str) -> NoReturn:
        """Raise an InputError, which says how a value with a minus sign is written."""
        if message.endswith(ONE_VALUE):
            name = message.split()[1].rstrip(":")
            message += f"; one with a minus sign is written {name}=-1,2"
        raise InputError(f"{message} (see '{self.prog} --help')")


class _Once(argparse.Action):
    """Action that stores the value of an option, which may be given once."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option: str | None = None,
    ) -> None:
        given = namespace.__dict__.setdefault("given", set())
        if option is not None and self.dest in given:
            before = getattr(namespace, self.dest)
            raise InputError(f"{option}: given twice, {before} and {values}")
        given.add(self.dest)
        setattr(namespace, self.dest, values)


class EachKeyOnce(argparse._AppendAction):
    """Action that collects `KEY=VALUE`; each key may be given once."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: Any,
        option: str | None = None,
    ) -> None:
        """Add one."""
        key = values.partition("=")[0]
        for before in getattr(namespace, self.dest):
            if before.partition("=")[0] == key:
                raise InputError(f"{option} {key}: given twice, {before} and {values}")
        super().__call__(parser, namespace, values, option)


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
