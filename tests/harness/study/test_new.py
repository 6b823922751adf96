"""A study of the user's own: its file says what was read, and its seeds decide."""

from __future__ import annotations

import math

import pytest
import yaml

from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.statistics.exact import clopper_pearson
from wayproof.harness.study.file import PACKAGED, read_study
from wayproof.harness.study.new import WORKFLOW, seeds_that_decide, study_text, write_new


@pytest.mark.parametrize(
    "name", [one.stem for one in PACKAGED.glob("*.toml") if "[import]" not in one.read_text()]
)
def test_a_written_study_is_read_alike(name, tmp_path):
    path = tmp_path / "own.toml"
    path.write_text(study_text(read_study(name)))
    assert read_study(str(path)) == read_study(name)


def test_the_number_of_seeds_is_the_least_that_holds_the_gate():
    alone = [f'gates=["success.mean >= {bound}"]' for bound in (0.95, 0.97)]
    for text, bound in zip(alone, (0.95, 0.97), strict=True):
        seeds = seeds_that_decide(read_study("ci", settings=[text]))
        assert (
            clopper_pearson(seeds, seeds).low >= bound > clopper_pearson(seeds - 1, seeds - 1).low
        )
    # of a wide gate the comparison decides: all five of its gates hold together
    few = seeds_that_decide(read_study("ci", settings=['gates=["success.mean >= 0.1"]']))
    many = seeds_that_decide(read_study("ci", settings=["robots=quadruped,drone"]))
    assert 40 < few < many


def test_what_no_number_of_seeds_shows_is_said():
    with pytest.raises(InputError, match=r"collisions\.mean <= 0'.*expected a wider bound"):
        seeds_that_decide(read_study("ci", settings=['gates=["collisions.mean <= 0"]']))


def test_a_workflow_runs_the_study(tmp_path):
    settings = ["stacks=stack.py:Mine", "name=mine", "episode.time_limit=7"]
    (tmp_path / "stack.py").write_text("class Mine: pass\n")
    study, workflow = write_new("ci", settings, "me/wayproof@v1", tmp_path)
    written = read_study(str(study), allow_plugins=True)
    assert written.stacks == ["stack.py:Mine"]
    assert written.settings == {"episode.time_limit": 7}
    assert math.isfinite(written.seeds)
    assert workflow == tmp_path / WORKFLOW
    steps = yaml.safe_load(workflow.read_text())["jobs"]["wayproof"]["steps"]
    assert steps[-1] == {"uses": "me/wayproof@v1", "with": {"study": "mine.toml"}}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["ci"], "'ci.toml' exists"),
        (["nothing"], "unknown study 'nothing'"),
        (["ci", "--set", "worlds=nowhere"], "'nowhere' (available"),
    ],
)
def test_bad_input_writes_nothing(words, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ci.toml").write_text("mine\n")
    assert main(["study", *words, "--new"]) == 2
    assert said in capsys.readouterr().err
    assert [one.name for one in tmp_path.iterdir()] == ["ci.toml"]
    assert (tmp_path / "ci.toml").read_text() == "mine\n"
