"""Verdict of a study as Markdown for a pull request, and as JUnit XML for a CI server."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from wayproof.harness.errors import printable
from wayproof.harness.study.gates import GateResult, gate_in_words, interval_in_words
from wayproof.harness.study.plan import name_of
from wayproof.harness.study.report.words import gate_reason
from wayproof.harness.study.study import StudyResult, verdict_in_words

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
        lines += ["| | gate | arm | estimate (95 %, all gates together) | reason |"]
        lines += ["|---|---|---|---|---|"]
        lines += [_gate_line(gate) for gate in result.gates]
        lines.append("")
    lines += ["<details><summary>Arms</summary>", ""]
    lines += ["| arm | episodes | success (95 %) | mean time, s | drop (95 %) | lost | won |"]
    lines += ["|---|---|---|---|---|---|---|"]
    for one in result.arms:
        rate = interval_in_words(one.success, ".2f")
        cells = [name_of(one.arm), str(one.episodes), rate, f"{one.mean_time:.1f}"]
        if one.against is None:
            cells += ["", "", ""]
        else:
            drop = interval_in_words(one.against.drop, "+.2f")
            cells += [drop, str(len(one.against.lost)), str(len(one.against.won))]
        lines.append(_row(cells))
    return "\n".join([*lines, "", "</details>"]) + "\n"


def _gate_line(gate: GateResult) -> str:
    estimate = "" if gate.interval is None else interval_in_words(gate.interval)
    mark = f"{MARKS[gate.verdict]} {gate.verdict}"
    return _row([mark, f"`{gate.gate}`", name_of(gate.arm), estimate, gate_reason(gate)])


def _row(cells: list[str]) -> str:
    return f"| {' | '.join(_text(cell) for cell in cells)} |"


def _text(text: str) -> str:
    """Return a text in which nothing is markup and no line ends."""
    return printable(text).replace("&", "&amp;").replace("<", "&lt;").replace("|", "\\|")


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
