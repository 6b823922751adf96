"""Interface of a verb of the command line, and functions that several verbs share."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from wayproof.harness.errors import InputError

if TYPE_CHECKING:
    from wayproof.harness.log.reader import Log
    from wayproof.harness.recordings.options import RecordingOptions
    from wayproof.harness.study.result import StudyResult

Document = dict[str, Any]

AddArguments = Callable[[argparse.ArgumentParser], object]
"""Declaration of arguments of a verb."""


@dataclass(frozen=True)
class Verb:
    """One verb: `wayproof NAME ...`.

    Attributes:
        help: One line that says what the verb does.
        add_arguments: Declares the arguments, except `--json`.
        run: Runs the verb; returns the exit code and the document that `--json` prints. It imports
            what it needs by itself, so that `--help` does not load the simulator.
        example: Command line that can be typed.
        kinds: Verbs of their own by the word that follows the name: `wayproof NAME KIND ...`.
    """

    help: str
    add_arguments: AddArguments
    run: Callable[[argparse.Namespace, Console], tuple[int, Document]]
    example: str
    kinds: Mapping[str, Verb] = field(default_factory=dict)


def arguments(*each: AddArguments) -> AddArguments:
    """Return the declaration of several arguments together."""

    def add(parser: argparse.ArgumentParser) -> None:
        for one in each:
            one(parser)

    return add


def arg(
    spec: str,
    text: str,
    kind: Callable[[str], Any] = str,
    default: Any = None,
    needs: Sequence[str] = (),
    **more: Any,
) -> AddArguments:
    """Return the declaration of one argument.

    Args:
        spec: `NAME` of a positional one, `--name VALUE` of an option, `--name` of a switch.
        text: Help; the default is added to it, unless it names one.
        kind: Makes the value of its word.
        default: Value where none is given.
        needs: Options that it needs; it is refused without them.
        more: Further settings of `ArgumentParser.add_argument`.
    """
    name, _, value = spec.partition(" ")
    text = f"with {' or '.join(needs)}: {text}" if needs else text
    settings: dict[str, Any] = {"help": text, "default": default, **more}
    if not name.startswith("--"):
        settings["metavar"], name = name, settings.pop("dest", name.lower())
    elif not value:
        settings = {"action": "store_true", **settings, "default": default or False}
    else:
        settings["metavar"] = value
    if settings.get("action") not in ("store_true", "store_false"):
        settings["type"] = kind
        if default not in (None, []) and "(default:" not in text:
            settings["help"] += f" (default: {default})"

    def add(parser: argparse.ArgumentParser) -> None:
        parser.add_argument(name, **settings).needs = needs  # type: ignore[attr-defined]

    return add


def given(kind: type[Any], options: argparse.Namespace) -> dict[str, Any]:
    """Return the fields of a dataclass or struct that options give, by the names of their values.

    Those that are None, False or empty keep the default of the field.
    """
    names = kind.__annotations__
    return {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in vars(options).items()
        if name in names and value is not None and value is not False and value != []
    }


def recording_options(options: argparse.Namespace) -> RecordingOptions:
    """Read the options of a recording."""
    from wayproof.harness.recordings.options import RecordingOptions

    return RecordingOptions(**given(RecordingOptions, options))


def numbers(name: str, text: str) -> tuple[float, ...]:
    """Read numbers with commas between them.

    Raises:
        InputError: One is not a number.
    """
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"{name} {text}: expected numbers with commas between them") from None


def point(name: str, text: str) -> tuple[float, ...]:
    """Read `X,Y` or `X,Y,Z`.

    Raises:
        InputError: It is something else.
    """
    try:
        values = numbers(name, text)
    except InputError:
        values = ()
    if len(values) not in (2, 3) or not all(map(math.isfinite, values)):
        raise InputError(f"{name} {text}: expected X,Y or X,Y,Z, finite numbers in m")
    return values


def write_summaries(
    options: argparse.Namespace, result: StudyResult, allow_inconclusive: bool = False
) -> None:
    """Write the files of `--markdown` and `--junit`.

    Raises:
        InputError: A file cannot be written.
    """
    from wayproof.harness.outputs import written_whole
    from wayproof.harness.study.report.summary import junit, markdown

    texts = (
        (options.markdown, markdown(result)),
        (options.junit, junit(result, allow_inconclusive)),
    )
    for path, text in texts:
        if path is not None:
            with written_whole(path, "summary") as partial:
                partial.write_text(text, encoding="utf-8")


def warn(text: str) -> None:
    """Print a warning on standard error."""
    print(f"wayproof: warning: {text}", file=sys.stderr)


def warn_of_changed_plugins(log: Log) -> list[str]:
    """Warn of each user's class whose file has changed since the log was written.

    Returns:
        Names of these classes.
    """
    from wayproof.harness.user_code import plugin_digests

    now = plugin_digests(log.config)
    changed = [name for name, digest in log.plugins.items() if now.get(name, digest) != digest]
    for name in changed:
        warn(
            f"the file of '{name}' has changed since the log was written "
            f"(SHA-256 {log.plugins[name][:12]} then, {now[name][:12]} now)"
        )
    return changed


def check_log(path: Path, options: argparse.Namespace) -> None:
    """Refuse a log whose result, chain or hashes do not follow from its content.

    Raises:
        InputError: The file is no log or damaged, or it contradicts itself and `--unchecked` is
            not given.
    """
    if options.unchecked:
        return
    from wayproof.harness.log.reader import open_log
    from wayproof.harness.replay.consistency import refuse_contradictions

    log = open_log(path, options.allow_plugins)
    refuse_contradictions(log, hint="; --unchecked reads it anyway")


def check_ending(name: str, path: Path | None, *endings: str) -> None:
    """Refuse a name of a file with another ending.

    Raises:
        InputError: It has one.
    """
    if path is not None and path.suffix not in endings:
        expected = " or ".join(endings)
        raise InputError(f"{name}: got '{path}', expected a name that ends in {expected}")


Replay = Callable[[Path, argparse.Namespace, Console], tuple[bool, Document]]
"""Replay of one log: prints its verdict, returns whether it is good and the document."""


def replay_each(
    replay: Replay, options: argparse.Namespace, console: Console
) -> tuple[int, Document]:
    """Replay one or more logs; exit code 1 if any is not good."""
    from wayproof.harness.log.reader import open_log

    outcomes = []
    for path in options.log:
        changed = warn_of_changed_plugins(open_log(path, True)) if options.allow_plugins else []
        good, document = replay(path, options, console)
        outcomes.append((good, {**document, "changed_plugins": changed}))
    code = 0 if all(good for good, _ in outcomes) else 1
    return code, one_or_all("replays", [document for _, document in outcomes])


def one_or_all(name: str, documents: list[Document]) -> Document:
    """Return the document of a verb that takes logs: flat for one log, else a list under `name`."""
    return documents[0] if len(documents) == 1 else {name: documents}
