"""The command `wayproof`: its verbs are in `harness.verbs`.

Exit codes: 0 as hoped (goal reached, replay identical, no rule broken), 1 not so, 2 bad input.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Container, Sequence
from typing import NoReturn

import msgspec
from rich.console import Console

from harness.errors import InputError, unknown_name
from harness.verbs import VERBS, Document

EXAMPLE = """\
  wayproof run warehouse --robot drone --seed 4 --perturb pose_jump:5 --log d.mcap
  wayproof explain d.mcap"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code."""
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    as_json = "--json" in arguments
    # What is told may be a stranger's: it is printed as it stands, and styles are set by `Text`.
    console = Console(quiet=as_json, markup=False, emoji=False)
    document: Document
    try:
        if arguments and not arguments[0].startswith("-") and arguments[0] not in VERBS:
            raise unknown_name("verb", arguments[0], VERBS)
        options = parsers(arguments[:1])[0].parse_args(arguments)
        code, document = VERBS[options.verb].run(options, console)
    except InputError as error:
        code, document = 2, {"error": str(error)}
        print(f"wayproof: {error}", file=sys.stderr)
    except KeyboardInterrupt:
        code, document = 130, {"error": "interrupted"}
        print("wayproof: interrupted; the log so far is readable as .partial", file=sys.stderr)
    if as_json:
        print(msgspec.json.encode(document).decode())
    return code


class _Parser(argparse.ArgumentParser):
    """An argument parser whose errors are our one-line errors."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see '{self.prog} --help')")


def verb_parsers() -> dict[str, argparse.ArgumentParser]:
    """The parser of each verb, by name."""
    return parsers()[1]


def parsers(
    whole: Container[str] = VERBS,
) -> tuple[argparse.ArgumentParser, dict[str, argparse.ArgumentParser]]:
    """The parser of the whole command, and those of its verbs, by name.

    Args:
        whole: Verbs that get their options; what these are checked against is imported for them.
    """
    parser = _Parser(
        prog="wayproof",
        description="Was the space that the robot entered proven safe, and if not, why did it go?",
        epilog=f"example:\n{EXAMPLE}\n\n'wayproof VERB --help' has one for each verb.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    verbs = parser.add_subparsers(title="verbs", required=True, metavar="VERB", dest="verb")
    each: dict[str, argparse.ArgumentParser] = {}
    for name, verb in VERBS.items():
        one = verbs.add_parser(
            name,
            help=verb.help,
            description=verb.help,
            epilog=f"example:\n  {verb.example}",
            formatter_class=argparse.RawDescriptionHelpFormatter,  # keeps the example in one line
        )
        if name in whole:
            verb.add_arguments(one)
        one.add_argument("--json", action="store_true", help="one JSON document on stdout")
        each[name] = one
    return parser, each
