"""`wayproof verify`: recompute everything in a log that can be recomputed, and sign it."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.text import Text

from wayproof.harness.cli import shared
from wayproof.harness.cli.differences import print_differences, print_elsewhere, print_scope
from wayproof.harness.cli.verb import Document, Verb, arg, arguments, one_or_all
from wayproof.harness.errors import InputError

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

    from wayproof.harness.replay.verify import Verification


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Verify one or more logs, and sign those that are verified; or make a key."""
    from wayproof.harness.replay.signature import read_private_key, read_public_key, signature_path
    from wayproof.harness.replay.verify import verify

    if options.new_key is not None:
        return _new_key(options, console)
    if not options.log:
        raise InputError("verify: got no log, expected at least one")
    key = None if options.key is None else read_public_key(options.key)
    private = None if options.sign is None else read_private_key(options.sign)
    verified, documents = [], []
    for path in options.log:
        one = verify(path, options.allow_plugins, options.simulation, key)
        print_verification(console, one)
        if key is None and private is None and signature_path(path).exists():
            console.print("  it has a signature, which was not checked: --key FILE checks it")
        document = asdict(one)
        if private is not None:
            document["signature"] = _sign(one, private, console)
        verified.append(one.verified)
        documents.append(document)
    return (0 if all(verified) else 1), one_or_all("verifications", documents)


def _new_key(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    from wayproof.harness.replay.signature import fingerprint, new_key, read_public_key

    if options.log:
        raise InputError("--new-key: makes keys only, expected no log with it")
    public = new_key(options.new_key)
    print_of_key = fingerprint(read_public_key(public))
    console.print(f"private key: {options.new_key}\npublic key: {public} {print_of_key}")
    return 0, {
        "private": str(options.new_key), "public": str(public), "fingerprint": print_of_key,
    }  # fmt: skip


def _sign(one: Verification, key: Ed25519PrivateKey, console: Console) -> Document | None:
    """Sign a log; nothing of one that was not verified."""
    from wayproof.harness.replay.signature import fingerprint, sign

    if not one.verified:
        console.print("  not signed")
        return None
    signature, print_of_key = sign(Path(one.log), key), fingerprint(key.public_key())
    console.print(f"signed: {signature} by {print_of_key}; chain {one.chain}")
    return {"signature": str(signature), "fingerprint": print_of_key}


def print_verification(console: Console, one: Verification) -> None:
    """Print the verdict on a log, what was found, and what the verdict covers."""
    console.print(Text.assemble(*_verdict(one)))
    if one.verified:
        print_scope(console, one.scope)
        return
    print_differences(console, one.findings[1:])
    if one.failed == "simulation" and one.elsewhere:
        print_elsewhere(console, one.elsewhere)


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


VERB = Verb(
    help="recompute everything in a log that can be recomputed; exit code 0 or 1",
    add_arguments=arguments(
        arg("LOG", "log file, repeatable", Path, nargs="*"),
        shared.plugins,
        arg(
            "--key PUBLIC",
            "Ed25519 public key, PEM or OpenSSH, whose signature the log must have",
            Path,
        ),
        arg(
            "--sign PRIVATE",
            "sign each log that is verified with this Ed25519 key, PEM or OpenSSH",
            Path,
        ),
        arg("--new-key FILE", "write a new private key, and FILE.pub, and nothing else", Path),
        arg(
            "--no-simulation",
            "skip the simulation; what only it can check remains a claim",
            dest="simulation",
            action="store_false",
            default=True,
        ),
    ),
    run=run,
    example="wayproof verify logs/warehouse-drone-3.mcap",
)
