"""`wayproof completion`: print the completion script of a shell."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path

from rich.console import Console

from wayproof.harness.cli.verb import Document, Verb

SHELLS = ("bash", "zsh")


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Print the script."""
    import shtab

    script = shtab.complete(_parser_with_values(), options.shell)
    if not console.quiet:
        console.file.write(f"{script}\n")  # as it is: rich would wrap it
    return 0, {"shell": options.shell, "script": script}


def _parser_with_values() -> argparse.ArgumentParser:
    """Return the parser of the command with the possible values of each argument."""
    import shtab

    from wayproof.harness.cli.main import parsers
    from wayproof.harness.perturbations import PERTURBATIONS
    from wayproof.harness.study.file import PACKAGED
    from wayproof.models.robots import ROBOTS
    from wayproof.models.worlds import WORLDS

    names: dict[str, Iterable[str]] = {
        "world": WORLDS,
        "robot": ROBOTS,
        "perturb": [f"{kind}:{severity}" for kind in PERTURBATIONS for severity in range(1, 6)],
        "study": [path.stem for path in PACKAGED.glob("*.toml")],
    }
    parser, verbs = parsers()
    for verb in verbs.values():
        for action in verb._actions:
            if action.dest in names and action.choices is None:
                action.choices = sorted(names[action.dest])
            elif action.type is Path:
                action.complete = shtab.FILE  # type: ignore[attr-defined]
    return parser


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("shell", choices=SHELLS, help="shell of the script")


VERB = Verb(
    help='print a completion script for bash or zsh: eval "$(wayproof completion bash)"',
    add_arguments=_add_arguments,
    run=run,
    example="wayproof completion bash",
)
