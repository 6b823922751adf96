"""The page of two builds: links that lead."""

from wayproof.harness.metrics import METRICS
from wayproof.harness.study.analysis import Sample
from wayproof.harness.study.plan import Arm
from wayproof.harness.study.report.builds import flips_of
from wayproof.harness.study.rows import Row

ARM = Arm("empty", "drone", "", "none", 0)


def row(seed, outcome="success", **metrics):
    own = {**dict.fromkeys(METRICS), "success": float(outcome == "success"), **metrics}
    return Row(f"key{seed}", ARM, seed, outcome, "", "", "chain", 5.0, own, (b"a",))


def sample(pairs):
    return Sample(ARM, [second for _, second in pairs], pairs, compared=True)


def test_flips_have_the_lost_ones_first_and_link_where_there_is_a_page(tmp_path):
    pairs = [(row(1, "timeout"), row(1)), (row(2), row(2, "collision")), (row(3), row(3))]
    page = tmp_path / "b" / "report" / "episodes" / "key2.html"
    page.parent.mkdir(parents=True)
    page.touch()
    flips = flips_of([sample(pairs)], tmp_path / "a", tmp_path / "b", tmp_path / "out.html")
    assert [(seed, after.side) for _, seed, _, after, *_ in flips] == [("2", "bad"), ("1", "good")]
    assert flips[0][2].link == ""
    assert flips[0][3].link == "b/report/episodes/key2.html"
