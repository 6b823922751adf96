"""The list of a study's episodes, and the view of one of them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.harness.study.here import BRIEF, HEAD, written
from tests.harness.viewer.test_rerun_view import entities
from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.study.episodes import entries_of, find_entry, unplanned_in_words
from wayproof.harness.study.file import read_study
from wayproof.harness.study.job import run_job
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import run_study


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A study of which one episode ran, its twin failed to, and one is under way."""
    folder = tmp_path_factory.mktemp("study")
    perturbed = "[perturbations]\npose_drift = [3]\nmotion = [2]\n"
    study = read_study(written(folder, f"{HEAD}seeds = 1{BRIEF}{perturbed}"))
    store = Store(folder / "out")
    planned = plan_episodes(study)

    def engine(jobs, stacks, finished):  # type: ignore[no-untyped-def]
        for job in jobs[:2]:
            finished(run_job(job))

    run_study(study, planned, store, engine, lambda _: None)
    store.log(planned[2].key).with_suffix(".mcap.partial").touch()
    return store.folder


def test_episodes_are_numbered_as_planned_with_their_twins(folder: Path) -> None:
    entries = entries_of(folder)
    assert [one.number for one in entries] == [1, 2, 3]
    assert [one.state for one in entries] == ["ended", "ended", "running"]
    assert [one.name for one in entries] == [
        "empty drone", "empty drone pose_drift:3", "empty drone motion:2",
    ]  # fmt: skip
    assert [one.outcome for one in entries] == ["timeout", "timeout", ""]
    assert entries[0].twin == ""
    assert entries[1].twin == entries[0].log
    assert entries[2].log.endswith(".mcap.partial")
    assert [one.failed for one in entries] == [True, True, False]


def test_an_episode_in_error_is_failed_and_has_no_log(folder: Path) -> None:
    key = Path(entries_of(folder)[2].log).name.partition(".")[0]
    error = folder / "errors" / f"{key}.json"
    error.write_text(json.dumps({"key": key, "error": "no memory"}))
    try:
        entry = entries_of(folder)[2]
        assert (entry.state, entry.outcome, entry.failed) == ("no log", "no memory", True)
        with pytest.raises(InputError, match=r"episode 3 .* has no log, no log: no memory"):
            find_entry(folder, entries_of(folder), 3)
    finally:
        error.unlink()


def test_logs_of_no_planned_episode_are_counted(folder, capsys):
    assert unplanned_in_words(folder) == ""
    other = folder / "logs" / "of_another_version.mcap"
    other.touch()
    try:
        assert unplanned_in_words(folder).startswith("1 log is of no planned episode")
        assert main(["view", str(folder)]) == 0
        assert "1 log is of no planned episode" in capsys.readouterr().out
    finally:
        other.unlink()


@pytest.mark.parametrize("number", [0, 4, -1])
def test_other_numbers_are_bad_input(folder: Path, number: int) -> None:
    with pytest.raises(InputError, match=f"no episode {number}, expected 1 to 3"):
        find_entry(folder, entries_of(folder), number)


def test_the_list_is_printed_and_one_is_shown_beside_its_twin(folder, tmp_path, capsys):
    pytest.importorskip("rerun")
    assert main(["view", str(folder)]) == 0
    out = capsys.readouterr().out
    assert "3 episodes, 2 ended, 2 failed" in out
    assert [line.split()[0] for line in out.splitlines()[1:4]] == ["1", "2", "3"]
    assert main(["view", str(folder), "--failed"]) == 0
    assert "motion:2" not in capsys.readouterr().out
    recording = tmp_path / "x.rrd"
    assert main(["view", str(folder), "2", "--twin", "--save", str(recording)]) == 0
    shown = entities(recording)
    assert "/log/world/robot" in shown
    assert "/other/world/robot" in shown


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["FOLDER", "--live"], "expected a log, got the folder of a study"),
        (["FOLDER", "--save", "x.rrd"], "expected the number of an episode"),
        (["FOLDER", "1", "--twin", "--save", "x.rrd"], "episode 1 has no twin"),
        (["FOLDER", "9", "--save", "x.rrd"], "no episode 9"),
        (["LOG", "1", "--save", "x.rrd"], "expected the folder of a study before it"),
        (["LOG", "--twin", "--save", "x.rrd"], "is not the folder of a study"),
        (["LOG", "--live", "--compare", "LOG", "--save", "x.rrd"], "expected one log"),
        (["none.mcap", "--live", "--save", "x.rrd"], "expected one that is being written"),
    ],
)
def test_bad_input_is_a_line(folder, tmp_path, monkeypatch, capsys, arguments, said):
    pytest.importorskip("rerun")
    monkeypatch.chdir(tmp_path)
    named = {"FOLDER": str(folder), "LOG": entries_of(folder)[0].log}
    assert main(["view", *(named.get(word, word) for word in arguments)]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not list(tmp_path.iterdir())
