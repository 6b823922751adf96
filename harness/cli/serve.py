"""`wayproof serve`: a stack of Python for a harness in another process."""

from __future__ import annotations

import argparse

from rich.console import Console

from wayproof.harness.cli.verb import Document, Verb


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Serve a stack on standard input and output, or on a socket, until it is ended."""
    from wayproof.harness.interface.serve import listen, serve

    if options.listen is not None:
        listen(options.stack, options.listen)
    serve(options.stack)
    return 0, {}


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("stack", metavar="STACK", help="a name of 'wayproof list' or module:Class")
    parser.add_argument(
        "--listen", metavar="ADDRESS", help="unix:PATH or tcp:HOST:PORT in place of the pipes"
    )


VERB = Verb(
    help="serve a stack to a harness in another process, on standard input and output",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof run office --robot drone --seed 1 --stack 'exec:wayproof serve gap'",
)
