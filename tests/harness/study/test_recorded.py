import contextlib
import io
import json
import shutil

import pytest

from tests.harness.shadow.conftest import BODY, FR079, written
from wayproof.harness.cli.main import main
from wayproof.harness.log.reader import open_log
from wayproof.harness.shadow.assess import assess
from wayproof.harness.shadow.summary import summarize
from wayproof.harness.study.file import read_study
from wayproof.harness.study.passes import passes_of
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import read_rows

pytestmark = pytest.mark.usefixtures("in_this_process")

STUDY = """
name = "cut"
recordings = ["{recording}"]
robots = ["{robot}"]
seeds = 1
gates = ["admitted_share.drop <= 0.5"]

[read]
end = {end}

[perturbations]
depth_noise = [5]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A study over 4 s of a real run, and what the command prints."""
    folder = tmp_path_factory.mktemp("recorded")
    robot = folder / "wheeled.toml"
    robot.write_text(BODY)
    (folder / "study.toml").write_text(STUDY.format(recording=FR079, robot=robot, end=4.0))
    return folder


@pytest.fixture(scope="module")
def document(folder, in_this_process):
    return study_of(folder)


def study_of(folder):
    said = io.StringIO()
    command = ["study", str(folder / "study.toml"), "--jobs", "1", "--json"]
    with contextlib.redirect_stdout(said):
        code = main([*command, "--out", str(folder / "out")])
    return json.loads(said.getvalue()) | {"code": code}


def test_each_arm_says_its_share_its_first_other_action_and_what_was_changed(document):
    plain, noisy = document["answers"]
    perturbed = [(one["arm"]["perturbation"], one["arm"]["severity"]) for one in (plain, noisy)]
    assert perturbed == [("none", 0), ("depth_noise", 5)]
    assert plain["admitted_share"] == 1.0
    assert (plain["first"], plain["change"]) == (None, None)
    assert noisy["change"] == noisy["admitted_share"] - 1.0 < 0.0
    assert noisy["first"] is not None
    assert noisy["actions"][0] != noisy["actions"][1]
    assert document["arms"] == []
    assert (noisy["changed"], noisy["undeclared"]) == (["sensor/FLASER"], [])
    assert (document["verdict"], document["code"]) == ("inconclusive", 3)
    assert [gate["worlds"] for gate in document["gates"]] == [1]  # one recording


def test_the_table_is_what_follows_from_the_logs(folder, document):
    planned = plan_episodes(read_study(str(folder / "study.toml")))
    store = Store(folder / "out")
    for one, passed in zip(planned, document["answers"], strict=True):
        summary = summarize(assess(store.log(one.key)))
        assert passed["admitted_share"] == summary.admitted_share
        assert open_log(store.log(one.key)).config.perturbation == one.config.perturbation
    first, second = read_rows(planned, store)
    assert len(first.actions) == len(second.actions) > 5
    passes = passes_of([first, second])
    assert [one.first for one in passes] == [one["first"] for one in document["answers"]]


def test_two_runs_are_compared_by_their_gates(folder, document, tmp_path, capsys):
    """The passes have no outcomes, so there is nothing to say of an arm's success."""
    out = str(folder / "out")
    gates = ["--gate", "admitted_share.drop <= 0.5", "--html", str(tmp_path / "page.html")]
    assert main(["compare", out, out, *gates, "--json"]) == 3
    compared = json.loads(capsys.readouterr().out)
    assert compared["arms"] == []
    assert [gate["verdict"] for gate in compared["gates"]] == ["inconclusive"] * 2
    assert [gate["interval"]["estimate"] for gate in compared["gates"]] == [0.0, 0.0]
    assert "2 of 2 passes through recordings judged" in (tmp_path / "page.html").read_text()


def test_a_second_run_runs_nothing_and_says_the_same(folder, document):
    logs = {path: path.stat().st_mtime_ns for path in (folder / "out/logs").glob("*.mcap")}
    assert study_of(folder)["answers"] == document["answers"]
    assert logs == {path: path.stat().st_mtime_ns for path in logs}


def test_a_log_in_the_place_of_another_counts_as_missing(folder, document, tmp_path):
    shutil.copytree(folder / "out", tmp_path / "out")
    (tmp_path / "study.toml").write_text((folder / "study.toml").read_text())
    plain, noisy = (tmp_path / f"out/logs/{one['key']}.mcap" for one in document["answers"])
    shutil.copyfile(plain, noisy)
    again = study_of(tmp_path)
    assert again["verdict"] == "incomplete"
    assert len(again["foreign"]) == 1


def test_its_report_has_a_row_for_each_pass(folder, document):
    assert main(["report", str(folder / "out")]) == 0
    page = (folder / "out/report.html").read_text()
    first = document["answers"][1]["first"]
    assert f"{first}: {' -&gt; '.join(document['answers'][1]['actions'])}" in page
    assert "100.0%" in page


def test_a_recording_that_never_moves_shows_nothing(tmp_path):
    (tmp_path / "wheeled.toml").write_text(BODY)
    still = written(tmp_path / "still.clf", [(0.0, 0.0, 0.0)] * 4)
    text = STUDY.format(recording=still, robot=tmp_path / "wheeled.toml", end=4.0)
    (tmp_path / "study.toml").write_text(text)
    document = study_of(tmp_path)
    assert document["answers"][0]["verdict"] == "nothing shown"
    assert document["answers"][0]["admitted_share"] is None
    assert document["verdict"] == "inconclusive"
    assert document["code"] == 3
