"""What a verb of the command line is, and the options that several share."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

if TYPE_CHECKING:
    from wayproof.harness.log.reader import Log

Document = dict[str, Any]

LOGS = Path("logs")


@dataclass(frozen=True)
class Verb:
    """One verb: `wayproof NAME ...`.

    Attributes:
        help: What it does, in a line.
        add_arguments: Declares its arguments, `--json` apart.
        run: Does it and returns the exit code and the document that `--json` prints. It imports
            what it needs itself, so that `--help` need not load the simulator.
        example: A line that can be typed.
    """

    help: str
    add_arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace, Console], tuple[int, Document]]
    example: str


def add_log_paths(parser: argparse.ArgumentParser) -> None:
    """One or more logs, and leave to run code that they name."""
    parser.add_argument("log", metavar="LOG", type=Path, nargs="+")
    add_plugins(parser)


def add_plugins(parser: argparse.ArgumentParser) -> None:
    """Leave to run code that logs and study files name."""
    parser.add_argument(
        "--allow-plugins",
        action="store_true",
        help="load the planner or controller that a log or a study names as module:Class or "
        "FILE.py:Class",
    )


def warn_of_changed_plugins(log: Log) -> list[str]:
    """Say of each of the user's classes whose file is not what the log was made with.

    Returns:
        Their names.
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
    """Leave to read a log that contradicts itself."""
    parser.add_argument(
        "--unchecked",
        action="store_true",
        help="read a log even if its result does not follow from its content",
    )


def check_log(path: Path, options: argparse.Namespace) -> None:
    """Refuse a log whose result, chain or hashes do not follow from its content.

    Raises:
        InputError: It is none, is damaged, or contradicts itself and `--unchecked` is not given.
    """
    if options.unchecked:
        return
    from wayproof.harness.log.reader import open_log
    from wayproof.harness.replay.consistency import refuse_contradictions

    log = open_log(path, options.allow_plugins)
    refuse_contradictions(log, hint="; --unchecked reads it anyway")


def add_log_folder(parser: argparse.ArgumentParser) -> None:
    """Where new logs go."""
    parser.add_argument("--logs", type=Path, default=LOGS, metavar="FOLDER", help="log folder")


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Settings in place of their defaults."""
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="override a setting, repeatable; names by 'wayproof list'",
    )


def one_or_all(name: str, documents: list[Document]) -> Document:
    """The document of a verb that takes several logs: flat for one, a list under `name` else."""
    return documents[0] if len(documents) == 1 else {name: documents}


MOST_CHECKED = 600.0
"""Simulated time after which `--check` begins no other remedy, s."""


def add_check(parser: argparse.ArgumentParser) -> None:
    """`--check [SECONDS]`."""
    parser.add_argument(
        "--check",
        type=float,
        nargs="?",
        const=MOST_CHECKED,
        metavar="SECONDS",
        help="check causes of failure by simulating again with one thing put right, until so much "
        f"time is simulated (default {MOST_CHECKED:g} s)",
    )
