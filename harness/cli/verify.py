"""`wayproof verify`: recompute everything in a log that can be recomputed."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.text import Text

from wayproof.harness.cli.replay import print_differences, print_elsewhere, print_scope
from wayproof.harness.cli.verb import Document, Verb, add_log_paths, one_or_all
from wayproof.harness.forked import cores

if TYPE_CHECKING:
    from wayproof.harness.replay.verify import Verification


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Verify one or more logs."""
    from wayproof.harness.replay.signature import read_public_key, signature_path
    from wayproof.harness.replay.verify import verify

    key = None if options.key is None else read_public_key(options.key)
    verifications = []
    for path in options.log:
        one = verify(path, options.allow_plugins, options.simulation, key, jobs=cores())
        print_verification(console, one)
        if key is None and signature_path(path).exists():
            console.print("  it has a signature, which was not checked: --key FILE checks it")
        verifications.append(one)
    code = 0 if all(one.verified for one in verifications) else 1
    return code, one_or_all("verifications", [asdict(one) for one in verifications])


def print_verification(console: Console, one: Verification) -> None:
    """Print the verdict on a log, what was found, and what the verdict covers."""
    console.print(Text.assemble(*_verdict(one)), soft_wrap=True, highlight=False)
    if not one.verified:
        print_differences(console, one.findings[1:])
        if one.failed == "simulation" and one.elsewhere:
            print_elsewhere(console, one.elsewhere)
        return
    print_scope(console, one.scope)


def _verdict(one: Verification) -> tuple[tuple[str, str] | str, ...]:
    tail = f"; {one.wall_time_s:.1f} s; chain {one.chain}; {one.log}"
    if not one.verified:
        first = one.findings[0]
        return (
            ("not verified", "bold red"),
            f" ({one.failed}): {first.field}: {first.recorded} -> {first.recomputed}{tail}",
        )
    done = {"replay": "replayed", "simulation": "simulated again", "signature": "signed"}
    steps = ", ".join(done[step] for step in one.steps if step in done)
    without = "" if "simulation" in one.steps else " without simulation"
    if not one.whole:
        without += " as far as it goes (the log breaks off)"
    return (
        ("verified", "bold green"),
        f"{without}: {one.outcome}, {one.decisions} decisions {steps}",
        (f"; audit: {one.violations} violations", "bold red") if one.violations else "",
        tail,
    )


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    add_log_paths(parser)
    parser.add_argument(
        "--key",
        type=Path,
        metavar="PUBLIC",
        help="Ed25519 public key, PEM or OpenSSH, whose signature the log must have",
    )
    parser.add_argument(
        "--no-simulation",
        dest="simulation",
        action="store_false",
        help="skip the simulation; what only it can check remains a claim",
    )


VERB = Verb(
    help="recompute everything in a log that can be recomputed; exit code 0 or 1",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof verify logs/warehouse-drone-3.mcap",
)
