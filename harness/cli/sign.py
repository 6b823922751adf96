"""`wayproof sign`: write an Ed25519 signature beside a log, or a new pair of keys."""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.console import Console

from wayproof.harness.cli.verb import (
    Document,
    Verb,
    add_plugins,
    add_unchecked,
    check_log,
    one_or_all,
)
from wayproof.harness.errors import InputError


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Make a key, or sign one or more logs."""
    if (options.new_key is None) == (options.key is None):
        raise InputError("sign: expected either --key FILE with logs, or --new-key FILE")
    if options.new_key is not None:
        if options.log:
            raise InputError("--new-key: makes keys only, expected no log with it")
        return _new_key(options.new_key, console)
    if not options.log:
        raise InputError("sign: got no log, expected at least one")
    return _sign(options, console)


def _new_key(path: Path, console: Console) -> tuple[int, Document]:
    from wayproof.harness.replay.signature import fingerprint, new_key, read_public_key

    public = new_key(path)
    print_of_key = fingerprint(read_public_key(public))
    console.print(f"private key: {path}\npublic key: {public} {print_of_key}", soft_wrap=True)
    return 0, {"private": str(path), "public": str(public), "fingerprint": print_of_key}


def _sign(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    from wayproof.harness.log.reader import open_log
    from wayproof.harness.replay.signature import fingerprint, read_private_key, sign

    key = read_private_key(options.key)
    print_of_key = fingerprint(key.public_key())
    documents: list[Document] = []
    for path in options.log:
        check_log(path, options)
        chain = open_log(path, options.allow_plugins).result["chain"]
        signature = sign(path, key)
        console.print(
            f"signed: {signature} by {print_of_key}; chain {chain}", soft_wrap=True, highlight=False
        )
        documents.append(
            {
                "log": str(path),
                "signature": str(signature),
                "fingerprint": print_of_key,
                "chain": chain,
            }
        )
    return 0, one_or_all("signatures", documents)


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("log", metavar="LOG", type=Path, nargs="*", help="log file, repeatable")
    parser.add_argument(
        "--key", type=Path, metavar="FILE", help="Ed25519 private key, PEM or OpenSSH"
    )
    parser.add_argument(
        "--new-key", type=Path, metavar="FILE", help="write a new private key, and FILE.pub"
    )
    add_plugins(parser)
    add_unchecked(parser)


VERB = Verb(
    help="sign a log with an Ed25519 key, so that 'verify --key' detects any change",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof sign logs/warehouse-drone-3.mcap --key me.pem",
)
