"""`wayproof serve`: a stack or a predictor of Python for a harness in another process."""

from __future__ import annotations

import argparse

from rich.console import Console

from wayproof.harness.cli.verb import Document, Verb, arg, arguments


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Serve a stack or a predictor on standard input and output, or on a socket."""
    from wayproof.harness.interface.serve import listen, serve

    if options.listen is not None:
        listen(options.stack, options.listen, options.predictor)
    serve(options.stack, options.predictor)
    return 0, {}


VERB = Verb(
    help="serve a stack or a predictor to a harness in another process, on its pipes or a socket",
    add_arguments=arguments(
        arg("STACK", "a name of 'wayproof list' or module:Class"),
        arg(
            "--predictor",
            "serve a predictor, as prediction.source takes it: module:Class or FILE.onnx",
        ),
        arg("--listen ADDRESS", "unix:PATH or tcp:HOST:PORT in place of the pipes"),
    ),
    run=run,
    example="wayproof run office --robot drone --seed 1 --stack 'exec:wayproof serve gap'",
)
