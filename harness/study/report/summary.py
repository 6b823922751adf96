"""Verdict of a study as Markdown for a pull request, and as JUnit XML for a CI server."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from urllib.parse import quote

from wayproof.harness.errors import printable
from wayproof.harness.study.gates import gate_in_words
from wayproof.harness.study.lost import MOST_SHOWN, lost_in_words
from wayproof.harness.study.plan import name_of
from wayproof.harness.study.report.page import Cell
from wayproof.harness.study.report.sections import (
    ARM_HEADS,
    arm_cells,
    changes_section,
    gates_section,
    lost_section,
)
from wayproof.harness.study.result import StudyResult
from wayproof.harness.study.study import verdict_in_words

MARKS = {
    "held": "✅",
    "complete": "📋",
    "failed": "❌",
    "incomplete": "❌",
    "inconclusive": "❔",
}
"""Mark of each verdict."""


def markdown(result: StudyResult) -> str:
    """Return the verdict, the gates and the arms as Markdown."""
    lines = [f"### {MARKS[result.verdict]} {_text(result.name)}: {result.verdict}", ""]
    lines += [_text(verdict_in_words(result)), ""]
    if result.gates:
        marks = {verdict: f"{mark} {verdict}" for verdict, mark in MARKS.items()}
        gates = gates_section(result).cells
        rows = [
            [marks[verdict.text], gate.text, arm.text, estimate.text, reason.text]
            for verdict, gate, arm, estimate, _, reason in gates
        ]
        heads = ["", "gate", "arm", "estimate (95 %, all gates together)", "reason"]
        lines += [*_table(heads, rows), ""]
    lost = lost_section(result)
    if lost is not None:
        lines += [*_table(lost.heads, [_texts(row) for row in lost.rows]), ""]
        pages = [one.page for one in result.lost if one.page][:MOST_SHOWN]
        links = [f"[{number}]({quote(page)})" for number, page in enumerate(pages, 1)]
        if links:
            lines += [f"With pictures of the last chance: {', '.join(links)}", ""]
    if result.changes:
        found = changes_section(result)
        lines += ["<details><summary>Differences</summary>", ""]
        lines += [*_table(found.heads, [_texts(row) for row in found.rows]), "", "</details>", ""]
    lines += ["<details><summary>Arms</summary>", ""]
    lines += _table(ARM_HEADS, [[cell.text for cell in arm_cells(one)] for one in result.arms])
    return "\n".join([*lines, "", "</details>"]) + "\n"


def _texts(row: Sequence[Cell | str]) -> list[str]:
    return [cell.text if isinstance(cell, Cell) else cell for cell in row]


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    return [f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}", *map(_row, rows)]


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(_text(cell) for cell in cells)} |"


MARKUP = str.maketrans(
    {one: f"\\{one}" for one in "\\`*[]|~"}
    | {"&": "&amp;", "<": "&lt;", "@": "@&#8203;", "_": "&#95;", "#": "&#35;"}
)
"""What would be Markdown, HTML or a mention of somebody -> the same as text."""


def _text(text: str) -> str:
    """Return a text in which nothing is markup and no line ends."""
    return printable(text).translate(MARKUP).replace("://", "&#58;//")


def junit(result: StudyResult, allow_inconclusive: bool = False) -> str:
    """Return a test case for each gate, and one for the completeness of the study, as JUnit XML.

    An inconclusive gate is an error: nothing was shown.

    Args:
        result: The result.
        allow_inconclusive: Skip inconclusive gates in place of that, except those that must be
            `proven`.
    """
    suite = ET.Element("testsuite", name=printable(result.name))
    case = ET.SubElement(suite, "testcase", classname=printable(result.name), name="episodes")
    if result.missing or result.errors:
        ET.SubElement(case, "error", message=printable(verdict_in_words(result)))
    if result.lost:
        pages = [f"[[ATTACHMENT|{one.page}]]" for one in result.lost if one.page][:MOST_SHOWN]
        text = " | ".join([*lost_in_words(result.lost), *pages])
        ET.SubElement(case, "system-out").text = printable(text)
    for gate in result.gates:
        name = printable(f"{gate.gate} for {name_of(gate.arm)}")
        case = ET.SubElement(suite, "testcase", classname=printable(result.name), name=name)
        words = printable(gate_in_words(gate))
        if gate.verdict == "failed":
            ET.SubElement(case, "failure", message=words)
        elif gate.verdict == "inconclusive":
            passes = allow_inconclusive and not gate.required
            ET.SubElement(case, "skipped" if passes else "error", message=words)
    for total, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        suite.set(total, str(len(suite.findall(f".//{tag}"))))
    suite.set("tests", str(len(suite)))
    ET.indent(suite)
    return f'<?xml version="1.0" encoding="utf-8"?>\n{ET.tostring(suite, encoding="unicode")}\n'
