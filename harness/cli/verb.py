"""Interface of a verb of the command line, and options that several verbs share."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

if TYPE_CHECKING:
    from wayproof.harness.config import StackConfig
    from wayproof.harness.log.reader import Log

Document = dict[str, Any]

LOGS = Path("logs")


@dataclass(frozen=True)
class Verb:
    """One verb: `wayproof NAME ...`.

    Attributes:
        help: One line that says what the verb does.
        add_arguments: Declares the arguments, except `--json`.
        run: Runs the verb; returns the exit code and the document that `--json` prints. It imports
            what it needs by itself, so that `--help` does not load the simulator.
        example: Command line that can be typed.
    """

    help: str
    add_arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace, Console], tuple[int, Document]]
    example: str


def add_log_paths(parser: argparse.ArgumentParser) -> None:
    """Add one or more logs and `--allow-plugins`."""
    parser.add_argument("log", metavar="LOG", type=Path, nargs="+", help="log file, repeatable")
    add_plugins(parser)


def add_plugins(parser: argparse.ArgumentParser) -> None:
    """Add `--allow-plugins`: permission to run code that logs and study files name."""
    parser.add_argument(
        "--allow-plugins",
        action="store_true",
        help="run the planner or controller that a log or study names as module:Class or "
        "FILE.py:Class",
    )


def warn_of_changed_plugins(log: Log) -> list[str]:
    """Warn of each user's class whose file has changed since the log was written.

    Returns:
        Names of these classes.
    """
    from wayproof.harness.user_code import plugin_digests

    now = plugin_digests(log.config)
    changed = [name for name, digest in log.plugins.items() if now.get(name, digest) != digest]
    for name in changed:
        print(
            f"wayproof: warning: the file of '{name}' has changed since the log was written "
            f"(SHA-256 {log.plugins[name][:12]} then, {now[name][:12]} now)",
            file=sys.stderr,
        )
    return changed


def add_unchecked(parser: argparse.ArgumentParser) -> None:
    """Add `--unchecked`: permission to read a log that contradicts itself."""
    parser.add_argument(
        "--unchecked",
        action="store_true",
        help="read the log even if its result does not follow from its content",
    )


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


def add_log_folder(parser: argparse.ArgumentParser) -> None:
    """Add `--logs`."""
    parser.add_argument(
        "--logs",
        type=Path,
        default=LOGS,
        metavar="FOLDER",
        help="folder for new logs (default: logs)",
    )


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Add `--set KEY=VALUE`."""
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="override a setting, repeatable; 'wayproof list' shows the names",
    )


def one_or_all(name: str, documents: list[Document]) -> Document:
    """Return the document of a verb that takes logs: flat for one log, else a list under `name`."""
    return documents[0] if len(documents) == 1 else {name: documents}


MAX_CHECKED = 600.0
"""Default simulated time after which `--check` starts no further simulation, s."""


def add_stack(parser: argparse.ArgumentParser) -> None:
    """Add `--stack` and `--guard`."""
    parser.add_argument(
        "--stack",
        metavar="STACK",
        help="put a stack on trial: a name of 'wayproof list', module:Class, file.py:Class, "
        "policy:FILE.onnx, exec:COMMAND, unix:PATH, tcp:HOST:PORT or ros2[:KEY=VALUE,...]",
    )
    parser.add_argument(
        "--guard", action="store_true", help="brake where the referee does not admit a command"
    )


def stack_of(options: argparse.Namespace) -> StackConfig:
    """Return the stack that `--stack` and `--guard` give; the built-in one without.

    Raises:
        InputError: A guard, which the built-in stack has no use for.
    """
    from wayproof.harness.config import BUILTIN, StackConfig

    stack = StackConfig(BUILTIN if options.stack is None else options.stack, options.guard)
    refuse_idle_guard(stack)
    return stack


def refuse_idle_guard(stack: StackConfig) -> None:
    """Refuse a guard of the built-in stack, which would have no effect.

    Raises:
        InputError: It is one.
    """
    from wayproof.harness.config import BUILTIN
    from wayproof.harness.errors import InputError

    if stack.guard and stack.name == BUILTIN:
        raise InputError("--guard: expected --stack; the built-in stack has no referee")


def add_check(parser: argparse.ArgumentParser) -> None:
    """Add `--check [SECONDS]`."""
    parser.add_argument(
        "--check",
        type=float,
        nargs="?",
        const=MAX_CHECKED,
        metavar="SECONDS",
        help="check causes of failure by simulating again with one thing corrected at a time, for "
        f"at most so much simulated time (default {MAX_CHECKED:g} s)",
    )
