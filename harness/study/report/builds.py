"""Page that compares two builds: what got better or worse, and which episodes changed sides."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from wayproof.harness.outputs import written_whole
from wayproof.harness.study.analysis import Sample
from wayproof.harness.study.compare import Compared
from wayproof.harness.study.plan import name_of
from wayproof.harness.study.report.page import Cell, Section
from wayproof.harness.study.report.report import SITE, result_page
from wayproof.harness.study.report.sections import changes_section, gates_section
from wayproof.harness.study.report.words import number
from wayproof.harness.study.rows import Row, first_difference


def write_comparison(compared: Compared, before: Path, after: Path, out: Path) -> None:
    """Write the page.

    Args:
        compared: Comparison of two folders.
        before: Folder of the first build.
        after: Folder of the second build.
        out: HTML file.

    Raises:
        InputError: The file cannot be written.
    """
    builds: list[list[Cell | str]] = [
        [name, Cell(str(folder), link=_site(folder, out, "index.html"))]
        for name, folder in (("before", before), ("after", after))
    ]
    sections = [
        Section("Builds", heads=("build", "folder"), rows=builds),
        gates_section(compared.result),
        changes_section(compared.result),
        Section(
            "Episodes with another outcome",
            heads=("episode", "seed", "before", "after", "cause", "first differing decision"),
            rows=flips_of(compared.samples, before, after, out) or [["none", *[""] * 5]],
        ),
    ]
    page = result_page(compared.result, sections, "Build against build")
    with written_whole(out, "page") as partial:
        partial.write_text(page.html(), encoding="utf-8")


def flips_of(
    samples: Sequence[Sample], before: Path, after: Path, out: Path
) -> list[list[Cell | str]]:
    """Return a row for each episode of another outcome, the lost ones first, with links."""
    pairs = [pair for one in samples for pair in one.pairs if pair[0].outcome != pair[1].outcome]
    pairs.sort(key=lambda pair: ("bad", "", "good").index(_side(*pair)))
    rows: list[list[Cell | str]] = []
    for first, second in pairs:
        rows.append(
            [
                name_of(second.arm),
                str(second.seed),
                Cell(first.outcome, link=_site(before, out, f"episodes/{first.key}.html")),
                Cell(
                    second.outcome,
                    _side(first, second),
                    link=_site(after, out, f"episodes/{second.key}.html"),
                ),
                second.cause or first.cause,
                number(first_difference(second, first), "d"),
            ]
        )
    return rows


def _side(first: Row, second: Row) -> str:
    """Return `good` or `bad` where one of the two builds succeeded."""
    if first.success == second.success:
        return ""
    return "good" if second.success else "bad"


def _site(folder: Path, out: Path, name: str) -> str:
    """Return the link from a page to one of a folder's site; empty if it has none."""
    page = folder / SITE / name
    return os.path.relpath(page, out.parent) if page.is_file() else ""
