"""The page of two builds: colours only where an interval shows a side, and links that lead."""

import pytest

from wayproof.harness.metrics import METRICS
from wayproof.harness.study.analysis import Sample
from wayproof.harness.study.plan import Arm
from wayproof.harness.study.report.builds import changes_of, flips_of
from wayproof.harness.study.rows import Row

ARM = Arm("empty", "drone", "", "none", 0)


def row(seed, outcome="success", **metrics):
    own = {**dict.fromkeys(METRICS), "success": float(outcome == "success"), **metrics}
    return Row(f"key{seed}", ARM, seed, outcome, "", "", "chain", 5.0, own, (b"a",))


def sample(pairs):
    return Sample(ARM, [second for _, second in pairs], pairs, compared=True)


def test_a_difference_is_coloured_where_its_whole_interval_has_a_side():
    far = sample(
        [
            (row(n, least_clearance=0.5 + 0.01 * n), row(n, least_clearance=0.1 + 0.02 * n))
            for n in range(12)
        ]
    )
    changes = changes_of([far], 60.0)
    found = {one.metric: one for one in changes}
    assert {one.arm for one in changes} == {"empty drone"}
    clearance = found["least_clearance"]
    assert clearance.before - clearance.after == pytest.approx(0.345)
    assert clearance.difference.estimate == pytest.approx(-0.345)
    assert clearance.side == "bad"
    assert found["success"].side == ""  # the same in every pair


def test_two_pairs_show_no_side():
    two = sample([(row(n, ate=0.0), row(n, ate=9.0)) for n in range(2)])
    changes = changes_of([two], 60.0)
    assert {one.metric: one.side for one in changes}["ate"] == ""


def test_a_metric_of_neither_build_is_left_out():
    changes = changes_of([sample([(row(n), row(n)) for n in range(6)])], 60.0)
    assert [one.metric for one in changes] == ["success"]


def test_flips_have_the_lost_ones_first_and_link_where_there_is_a_page(tmp_path):
    pairs = [(row(1, "timeout"), row(1)), (row(2), row(2, "collision")), (row(3), row(3))]
    page = tmp_path / "b" / "report" / "episodes" / "key2.html"
    page.parent.mkdir(parents=True)
    page.touch()
    flips = flips_of([sample(pairs)], tmp_path / "a", tmp_path / "b", tmp_path / "out.html")
    assert [(seed, after.side) for _, seed, _, after, *_ in flips] == [("2", "bad"), ("1", "good")]
    assert flips[0][2].link == ""
    assert flips[0][3].link == "b/report/episodes/key2.html"
