"""`wayproof robot check`: the faults of a robot's spec file, and a spec that would do."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.console import Console

from wayproof.harness.cli.verb import Document, Verb
from wayproof.harness.errors import InputError
from wayproof.harness.outputs import written_whole


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Check a spec file, or propose one for an MJCF, and print the findings."""
    from wayproof.models.robots.custom.checking import check_spec

    path: Path = options.file
    if not path.is_file():
        raise InputError(f"robot check: no file '{path}'")
    if path.suffix not in (".toml", ".xml", ".mjcf"):
        raise InputError(f"robot check: got '{path}', expected a spec file (.toml) or an MJCF")
    checked = check_spec(path, None if options.out is None else options.out.parent)
    proposed = "" if checked.proposal is None else checked.proposal.toml()
    for line in checked.wrong:
        console.print(f"{path}: {line}", soft_wrap=True, highlight=False)
    if not checked.wrong and path.suffix == ".toml":
        console.print(f"{path}: fits", soft_wrap=True)
    if options.out is not None:
        if not proposed:
            raise InputError(f"{path}: {checked.unproposed}")
        with written_whole(options.out, "--out") as partial:
            partial.write_text(proposed, encoding="utf-8")
        console.print(f"{options.out}: proposed", soft_wrap=True)
    elif proposed and (checked.wrong or path.suffix != ".toml"):
        console.print(proposed, soft_wrap=True, highlight=False, markup=False)
    elif not proposed:
        console.print(f"no spec proposed: {checked.unproposed}", soft_wrap=True, highlight=False)
    document: Document = {
        "file": str(path), "wrong": checked.wrong, "proposed": proposed,
        "unproposed": checked.unproposed,
    }  # fmt: skip
    failed = bool(checked.wrong) or (path.suffix != ".toml" and not proposed)
    return int(failed), document


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("action", choices=("check",), help="what to do")
    parser.add_argument(
        "file", metavar="FILE", type=Path, help="spec file of a robot, or an MJCF to propose one"
    )
    parser.add_argument(
        "--out", type=Path, metavar="SPEC.toml",
        help="write the proposed spec there (default: print it)",
    )  # fmt: skip


VERB = Verb(
    help="check a robot's spec file, or propose one for its MJCF",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof robot check models/robots/custom/examples/go2.toml",
)
