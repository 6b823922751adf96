"""Options that write a verdict for a pull request or a CI server."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from wayproof.harness.study.study import StudyResult


def add_summaries(parser: argparse.ArgumentParser) -> None:
    """Add `--markdown` and `--junit`."""
    parser.add_argument(
        "--markdown", type=Path, metavar="FILE", help="write the verdict for a pull request"
    )
    parser.add_argument(
        "--junit",
        type=Path,
        metavar="FILE",
        help="write each gate as a test case for a CI server; an inconclusive one is an error",
    )


def write_summaries(
    options: argparse.Namespace, result: StudyResult, allow_inconclusive: bool = False
) -> None:
    """Write the requested files.

    Raises:
        InputError: A file cannot be written.
    """
    from wayproof.harness.outputs import written_whole
    from wayproof.harness.study.report.summary import junit, markdown

    texts = (
        (options.markdown, markdown(result)),
        (options.junit, junit(result, allow_inconclusive)),
    )
    for path, text in texts:
        if path is not None:
            with written_whole(path, "summary") as partial:
                partial.write_text(text, encoding="utf-8")
