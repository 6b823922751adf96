"""The command `wayproof`.

Exit codes: 0 success (goal reached, replay identical, no rule broken), 1 failure, 2 bad input, 130
Ctrl-C, 141 a reader of standard output that went away.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Container, Sequence
from typing import NoReturn

import msgspec
from rich.console import Console

from wayproof.harness.cli import VERBS, Document
from wayproof.harness.cli.arguments import check_options, refusing_unusable_paths
from wayproof.harness.cli.fast_exit import FastExit, runs_only_our_code
from wayproof.harness.cli.parent_process import fork_child, names_user_code
from wayproof.harness.cli.stdout import CheckedStdout, OutputError
from wayproof.harness.errors import InputError, Interrupted, unknown_name
from wayproof.harness.supervision import ended

EXAMPLE = """\
  wayproof run warehouse --robot drone --seed 4 --perturb pose_jump:5 --log d.mcap
  wayproof explain d.mcap"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code.

    Args:
        arguments: Words of the command; None for those of this process, which may be forked.
    """
    exit_handler = FastExit() if arguments is None else None
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    as_json = "--json" in arguments
    stdout = CheckedStdout(sys.stdout)
    # Printed text may come from a log of unknown origin: no markup in it; `Text` sets the styles.
    console = Console(file=stdout, quiet=as_json, markup=False, emoji=False)  # type: ignore[arg-type]
    document: Document
    try:
        try:
            with refusing_unusable_paths(arguments):
                code, document = _run(arguments, console, exit_handler)
        except InputError as error:
            code, document = 2, {"error": str(error)}
            print(f"wayproof: {error}", file=sys.stderr)
        except KeyboardInterrupt as error:
            text = f"interrupted; {error}" if isinstance(error, Interrupted) else "interrupted"
            code, document = 130, {"error": text}
            print(f"wayproof: {text}", file=sys.stderr)
        if as_json and document:
            stdout.write(f"{msgspec.json.encode(document).decode()}\n")
        stdout.flush()
    except OutputError as error:
        return error.give_up()
    finally:
        ended()
    if exit_handler is not None and exit_handler.allowed:
        exit_handler.code = code
    return code


def _run(
    arguments: Sequence[str], console: Console, exit_handler: FastExit | None
) -> tuple[int, Document]:
    """Run one command; return its exit code and the document of `--json`, which may be empty.

    Args:
        arguments: Words of the command.
        console: Where it prints.
        exit_handler: That of its own process, which may be forked; None without one.
    """
    if not arguments:
        parsers(())[0].print_help(sys.stderr)
        return 2, {}
    if not arguments[0].startswith("-") and arguments[0] not in VERBS:
        raise unknown_name("verb", arguments[0], VERBS)
    parser, verbs = parsers(arguments[:1])
    if arguments[0] in VERBS:
        check_options(verbs[arguments[0]], arguments[1:])
    options = parser.parse_args(arguments)
    if exit_handler is not None and options.verb == "run" and names_user_code(options):
        exit_code = fork_child()
        if exit_code is not None:
            return exit_code, {}
    if exit_handler is not None:
        exit_handler.allowed = runs_only_our_code(options)
    return VERBS[options.verb].run(options, console)


class _Version(argparse.Action):
    """Option that looks the version up and prints it."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        """Print the version and exit."""
        from importlib.metadata import version

        print(f"wayproof {version('wayproof')}")
        parser.exit()


class _Parser(argparse.ArgumentParser):
    """Argument parser that raises `InputError`."""

    def error(self, message: str) -> NoReturn:
        raise InputError(f"{message} (see '{self.prog} --help')")


def verb_parsers() -> dict[str, argparse.ArgumentParser]:
    """Return the parser of each verb by name."""
    return parsers()[1]


def parsers(
    whole: Container[str] = VERBS,
) -> tuple[argparse.ArgumentParser, dict[str, argparse.ArgumentParser]]:
    """Return the parser of the whole command, and those of its verbs by name.

    Args:
        whole: Verbs whose options are added, which may import modules.
    """
    parser = _Parser(
        prog="wayproof",
        description="Was the space that the robot entered proven safe, and if not, why did it go?",
        epilog=f"example:\n{EXAMPLE}\n\n'wayproof VERB --help' shows one for each verb.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version")
    verbs = parser.add_subparsers(title="verbs", required=True, metavar="VERB", dest="verb")
    each: dict[str, argparse.ArgumentParser] = {}
    for name, verb in VERBS.items():
        verb_parser = verbs.add_parser(
            name,
            help=verb.help,
            description=verb.help,
            epilog=f"example:\n  {verb.example}",
            formatter_class=argparse.RawDescriptionHelpFormatter,  # keeps the example in one line
        )
        if name in whole:
            verb.add_arguments(verb_parser)
        verb_parser.add_argument("--json", action="store_true", help="one JSON document on stdout")
        each[name] = verb_parser
    return parser, each
