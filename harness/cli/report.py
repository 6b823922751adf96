"""`wayproof report`: write the HTML report of a study."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path

from rich.console import Console

from wayproof.harness.cli import shared
from wayproof.harness.cli.study import print_foreign
from wayproof.harness.cli.verb import Document, Verb, arg, arguments, write_summaries
from wayproof.harness.errors import InputError


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Write the report of a study or a recording; exit code 0 whatever the verdict."""
    if options.folder.is_file():
        return _recording(options, console)
    from wayproof.harness.study.episodes import unplanned_in_words
    from wayproof.harness.study.report.report import write_report
    from wayproof.harness.study.study import verdict_in_words

    path, result = write_report(options.folder, options.allow_plugins)
    write_summaries(options, result)
    print_foreign(console, result)
    console.print(verdict_in_words(result))
    if other := unplanned_in_words(options.folder, options.allow_plugins):
        console.print(other)
    console.print(f"report: {path}")
    console.print(f"one page to send: {options.folder / 'report.html'}")
    return 0, {**asdict(result), "verdict": result.verdict, "report": str(path)}


def _recording(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Write the page of a recording's log."""
    from wayproof.harness.shadow.page import write_page

    if options.markdown is not None or options.junit is not None:
        raise InputError("--markdown, --junit: expected the folder of a study, got a log")
    out = options.folder.with_suffix(".html")
    summary = write_page(options.folder, out, options.allow_plugins)
    console.print(f"{summary.verdict}: {summary.reason}")
    console.print(f"page: {out}")
    return 0, {**asdict(summary), "report": str(out)}


VERB = Verb(
    help="write a study as a site and one self-contained HTML page, or a recording as a page",
    add_arguments=arguments(
        arg("FOLDER", "folder of a study, or log of a recording", Path),
        shared.summaries,
        shared.plugins,
    ),
    run=run,
    example="wayproof report logs/smoke",
)
