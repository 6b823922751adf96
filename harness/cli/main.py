"""The command `wayproof`.

Exit codes: 0 success (goal reached, replay identical, no rule broken), 1 failure, 2 bad input, 130
Ctrl-C, 141 a reader of standard output that went away.
"""

from __future__ import annotations

import argparse
import gc
import os
import sys
from collections.abc import Sequence

import msgspec
from rich.console import Console

from wayproof.harness.cli import COMMANDS, VERBS, Document, Verb
from wayproof.harness.cli.arguments import Parser, refusing_unusable_paths
from wayproof.harness.cli.fast_exit import FastExit, runs_only_our_code
from wayproof.harness.cli.parent_process import fork_child, names_user_code
from wayproof.harness.cli.stdout import CheckedStdout, OutputError, PlainConsole
from wayproof.harness.errors import InputError, Interrupted, unknown_name
from wayproof.harness.supervision import ended

EXAMPLE = """\
  wayproof run warehouse --robot drone --seed 4 --perturb pose_jump:5 --log d.mcap
  wayproof explain d.mcap"""

GARBAGE_THRESHOLD = 50_000
"""Objects between two collections of garbage; by the default of 700 they take a tenth of a short
command, which only loads modules."""

SHELLS = ("bash", "zsh", "fish")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code.

    Args:
        arguments: Words of the command; None for those of this process, which may be forked.
    """
    gc.set_threshold(GARBAGE_THRESHOLD)
    exit_handler = FastExit() if arguments is None else None
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    as_json = "--json" in arguments
    stdout = CheckedStdout(sys.stdout)
    # Printed text may come from a log of unknown origin: no markup in it, and no control of the
    # terminal; `Text` sets the styles.
    console = PlainConsole(
        file=stdout,  # type: ignore[arg-type]
        quiet=as_json,
        markup=False,
        emoji=False,
        highlight=False,
        soft_wrap=True,
    )
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
    words: Sequence[str], console: Console, exit_handler: FastExit | None
) -> tuple[int, Document]:
    """Run one command; return its exit code and the document of `--json`, which may be empty.

    Args:
        words: Words of the command.
        console: Where it prints.
        exit_handler: That of its own process, which may be forked; None without one.
    """
    if not words:
        whole_parser().print_help(sys.stderr)
        return 2, {}
    if words[0].startswith("-"):
        return _answer(whole_parser().parse(words, ""), console)
    options = parse(words)
    if exit_handler is not None and options.verb == "run" and names_user_code(options):
        exit_code = fork_child()
        if exit_code is not None:
            return exit_code, {}
    if exit_handler is not None:
        exit_handler.allowed = runs_only_our_code(options)
        if exit_handler.allowed and options.verb == "run":
            _load_physics()
    return COMMANDS[options.verb].run(options, console)


def _load_physics() -> None:
    """Load MuJoCo without GLFW, which takes a twentieth of a short command: nothing here draws."""
    given = os.environ.get("MUJOCO_GL")
    os.environ["MUJOCO_GL"] = "disable"
    import mujoco  # noqa: F401

    del os.environ["MUJOCO_GL"]  # a stack in a process of its own may draw
    if given is not None:
        os.environ["MUJOCO_GL"] = given


def parse(words: Sequence[str]) -> argparse.Namespace:
    """Return the options of a command and, as `verb`, its name.

    Raises:
        InputError: There is no such verb or option, or a value of another kind.
    """
    name, rest = split_command(words)
    return parser_of(name).parse(rest, name)


def split_command(words: Sequence[str]) -> tuple[str, list[str]]:
    """Return the name of a command, which may be of two words, and the words after it.

    Raises:
        InputError: There is no such verb.
    """
    verb, *rest = words
    if verb not in VERBS:
        raise unknown_name("verb", verb, VERBS)
    if rest and rest[0] in VERBS[verb].kinds:
        return f"{verb} {rest[0]}", rest[1:]
    return verb, rest


def parser_of(name: str) -> Parser:
    """Return the parser of the words after the name of a command."""
    verb = COMMANDS[name]
    parser = Parser(prog=f"wayproof {name}", description=verb.help, epilog=_epilog(name, verb))
    verb.add_arguments(parser)
    parser.add_argument("--json", action="store_true", help="one JSON document on stdout")
    return parser


def _epilog(name: str, verb: Verb) -> str:
    kinds = "".join(f"\n  wayproof {name} {kind}: {one.help}" for kind, one in verb.kinds.items())
    return f"example:\n  {verb.example}" + (f"\n\nkinds:{kinds}" if kinds else "")


def whole_parser() -> Parser:
    """Return the parser of the command's own options, whose help lists the verbs."""
    width = max(map(len, VERBS))
    verbs = "\n".join(f"  {name:{width}}  {verb.help}" for name, verb in VERBS.items())
    parser = Parser(
        prog="wayproof",
        usage="wayproof VERB ...",
        description="Was the space that the robot entered proven safe, and if not, why did it go?",
        epilog=f"verbs:\n{verbs}\n\nexample:\n{EXAMPLE}\n\n"
        "'wayproof VERB --help' shows one for each verb.",
    )
    parser.add_argument("--version", action="store_true", help="print the version")
    parser.add_argument(
        "--completion",
        choices=SHELLS,
        help='print the completion script of a shell: eval "$(wayproof --completion bash)"',
    )
    return parser


def _answer(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Print what an option of the command itself asks for."""
    if options.version:
        from importlib.metadata import version

        console.print(f"wayproof {version('wayproof')}")
    elif options.completion:
        from wayproof.harness.cli.completion import script

        console.file.write(f"{script(options.completion)}\n")  # as it is: rich may wrap it
    return 0, {}
