"""`wayproof import robot`: the faults of a robot's spec file, or a spec proposed for an MJCF."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.console import Console

from wayproof.harness.cli.verb import Document, Verb, arg, arguments
from wayproof.harness.errors import InputError
from wayproof.harness.outputs import written_whole


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Check a spec file, or propose one for an MJCF, and print the findings."""
    from wayproof.models.robots.custom.proposal import check_spec

    path: Path = options.file
    if not path.is_file():
        raise InputError(f"import robot: no file '{path}'")
    if path.suffix not in (".toml", ".xml", ".mjcf"):
        raise InputError(f"import robot: got '{path}', expected a spec file (.toml) or an MJCF")
    is_spec = path.suffix == ".toml"
    checked = check_spec(path, None if options.out is None else options.out.parent)
    proposed = "" if checked.proposal is None else checked.proposal.toml()
    for line in checked.wrong:
        console.print(f"{path}: {line}")
    if is_spec and not checked.wrong:
        console.print(f"{path}: fits")
    if options.out is not None:
        if not proposed:
            raise InputError(f"{path}: {checked.unproposed}")
        with written_whole(options.out, "--out") as partial:
            partial.write_text(proposed, encoding="utf-8")
        console.print(f"{options.out}: proposed")
    elif proposed and (checked.wrong or not is_spec):
        console.print(proposed)
    elif not proposed:
        console.print(f"no spec proposed: {checked.unproposed}")
    document: Document = {
        "file": str(path), "wrong": checked.wrong, "proposed": proposed,
        "unproposed": checked.unproposed,
    }  # fmt: skip
    return int(bool(checked.wrong) or not (is_spec or proposed)), document


VERB = Verb(
    help="check a robot's spec file, or propose one for its MJCF",
    add_arguments=arguments(
        arg("FILE", "spec file of a robot, or an MJCF to propose one", Path),
        arg("--out SPEC.toml", "write the proposed spec there (default: print it)", Path),
    ),
    run=run,
    example="wayproof import robot models/robots/custom/examples/go2.toml",
)
