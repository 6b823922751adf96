"""Verdicts as Markdown and JUnit XML, text that is no markup, and the page of two builds."""

import xml.etree.ElementTree as ET
from dataclasses import replace

import pytest

from tests.harness.study.here import ARM, row
from wayproof.harness.statistics.exact import Interval
from wayproof.harness.study.analysis import ArmSummary, Sample
from wayproof.harness.study.gates import GateResult
from wayproof.harness.study.report.builds import flips_of
from wayproof.harness.study.report.summary import junit, markdown
from wayproof.harness.study.result import Paired, StudyResult
from wayproof.harness.study.study import verdict_in_words

RATE = Interval(0.5, 0.1, 0.9)


def gate(verdict, required=False, interval=RATE):
    return GateResult("success.mean >= 0.5", ARM, verdict, interval, 1, 6, None, required)


def result(*gates, missing=0, name="s"):
    summary = ArmSummary(ARM, 6, RATE, {"success": 3, "timeout": 3}, {}, 60.0, {}, None)
    return StudyResult(name, 6, missing, 0, "", [summary], list(gates))


def test_a_comparison_counts_its_pairs_on_both_sides():
    summary = ArmSummary(ARM, 20, RATE, {"success": 12, "timeout": 8}, {}, 60.0, {}, None)
    pairs = Paired(count=5, reached=4, reached_before=3)
    compared = StudyResult("b against a", 20, 15, 0, "", [summary], [], pairs=pairs)
    assert verdict_in_words(compared).startswith(
        "4 of 5 episodes reached the goal (before: 3 of 5); 15 of 20 have not run in both studies"
    )


@pytest.mark.parametrize(
    ("count", "said"),
    [
        (0, "No gate is set."),
        (1, "The gate is not judged: no episode that counts has ended."),
        (2, "The 2 gates are not judged: no episode that counts has ended."),
    ],
)
def test_gates_that_nothing_judged_are_not_said_to_be_none(count, said):
    unrun = StudyResult("s", 6, 6, 0, "", [], [], gates_set=count)
    assert unrun.verdict == "incomplete"
    assert verdict_in_words(unrun).endswith(said)


def cases(text):
    suite = ET.fromstring(text)
    return suite, {
        case.get("name"): [child.tag for child in case] for case in suite.iter("testcase")
    }


@pytest.mark.parametrize(
    ("verdict", "tags"),
    [("held", []), ("failed", ["failure"]), ("inconclusive", ["error"])],
)
def test_a_gate_is_a_test_case(verdict, tags):
    suite, found = cases(junit(result(gate(verdict))))
    assert found == {"episodes": [], "success.mean >= 0.5 for warehouse drone": tags}
    assert suite.get("tests") == "2"
    assert int(suite.get("failures")) == tags.count("failure")
    assert int(suite.get("errors")) == tags.count("error")


def test_only_gates_that_need_no_proof_are_skipped_on_request():
    lax = junit(result(gate("inconclusive")), allow_inconclusive=True)
    assert cases(lax)[1]["success.mean >= 0.5 for warehouse drone"] == ["skipped"]
    strict = junit(result(gate("inconclusive", required=True)), allow_inconclusive=True)
    assert cases(strict)[1]["success.mean >= 0.5 for warehouse drone"] == ["error"]


def test_an_incomplete_study_does_not_pass():
    _, found = cases(junit(result(gate("held"), missing=1)))
    assert found["episodes"] == ["error"]
    assert "❌ s: incomplete" in markdown(result(gate("held"), missing=1))
    assert "✅ s: held" in markdown(result(gate("held")))
    assert "📋 s: complete" in markdown(result())  # without a gate nothing has passed
    assert "❔ s: inconclusive" in markdown(result(gate("inconclusive", interval=None)))


def test_markdown_has_a_line_for_each_gate_and_arm():
    lines = markdown(result(gate("failed"), gate("held"))).splitlines()
    assert any(
        line.startswith("| ❌ failed | `success.mean &lt;") or "❌ failed" in line for line in lines
    )
    assert sum("| ✅ held |" in line for line in lines) == 1
    assert "| warehouse drone | 6 | 0.50 (0.10 to 0.90) | 60.0 |  |  |  |" in lines


def test_names_are_text_and_not_markup():
    strange = "a|b <img src=x>\n# c\x1b ![d](https://e.f/g.png) `@h`"
    shown = markdown(result(gate("held"), name=strange))
    assert "<img" not in shown
    assert "\n# c" not in shown
    assert "a\\|b" in shown
    assert "![d](" not in shown
    assert "https://" not in shown
    assert "@h" not in shown
    suite, _ = cases(junit(result(gate("held"), name=strange)))
    assert "\\x1b" in suite.get("name")


def test_an_unbounded_interval_is_words():
    wide = replace(gate("inconclusive"), interval=Interval(0.0, -float("inf"), float("inf")))
    for text in (markdown(result(wide)), junit(result(wide))):
        assert "unbounded" in text
        assert "inf " not in text
        assert "nan" not in text.replace("inconclusive", "")


def test_flips_have_the_lost_ones_first_and_link_where_there_is_a_page(tmp_path):
    pairs = [
        (row(1, outcome="timeout"), row(1)),
        (row(2), row(2, outcome="collision", key="key2")),
        (row(3), row(3)),
    ]
    page = tmp_path / "b" / "report" / "episodes" / "key2.html"
    page.parent.mkdir(parents=True)
    page.touch()
    both = Sample(ARM, [second for _, second in pairs], pairs, compared=True)
    flips = flips_of([both], tmp_path / "a", tmp_path / "b", tmp_path / "out.html")
    assert [(seed, after.side) for _, seed, _, after, *_ in flips] == [("2", "bad"), ("1", "good")]
    assert flips[0][2].link == ""
    assert flips[0][3].link == "b/report/episodes/key2.html"
