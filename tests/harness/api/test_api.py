"""The public Python interface on a real episode and a real study."""

from pathlib import Path

import numpy as np
import pytest

import wayproof
from wayproof.harness.log.reader import open_log
from wayproof.harness.viewer.moments import moments


@pytest.fixture(scope="module")
def episode(recorded):
    return wayproof.open(recorded("empty", "drone", 1).log)


def test_settings_and_perturbation_reach_the_log(tmp_path):
    settings = {"map.resolution": 0.2, "episode.time_limit": 0.3, "latency.mode": "modelled"}
    made = wayproof.run(
        "empty", robot="drone", seed=2, settings=settings, perturb="pose_jump:2", log=tmp_path / "d"
    )
    assert made.config.map.resolution == 0.2
    assert made.config.perturbation.kind == "pose_jump"
    assert made.outcome == "timeout"
    assert made.log.path == tmp_path / "d"
    assert len(made.decisions()) == len(made.truth()) == len(made.poses()) > 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"settings": {"map.resolutoin": 0.2}}, "did you mean 'map.resolution'"),
        ({"settings": {"map.resolution": 9}}, "expected 0.01 to 0.5 m"),
        ({"perturb": "pose_drift"}, "expected pose_drift:SEVERITY"),
        ({"robot": "Drone"}, "did you mean 'drone'"),
    ],
)
def test_bad_input_is_one_line(tmp_path, change, message):
    given = {"robot": "drone", "seed": 1, "log": tmp_path / "d.mcap", **change}
    with pytest.raises(wayproof.InputError, match=message):
        wayproof.run("empty", **given)
    assert not list(tmp_path.iterdir())


def test_the_map_is_the_one_that_the_decision_names(episode):
    mapped = episode.map_at(7)
    assert mapped.version == episode.decisions()["map_version"][7].as_py()
    assert set(np.unique(mapped.states)) == {0, 1, 2}
    for moment in moments(open_log(episode.log.path)):
        if moment.decision.sequence == 7:
            cell = np.argwhere(mapped.states == 2)[100]
            place = mapped.low + (cell + 0.5) * mapped.resolution
            assert moment.map.state_at(place[None])[0] == 2
            break
    assert mapped.costs.shape == mapped.distances.shape
    assert (mapped.distances[mapped.costs == 254] == 0.0).all()
    beside = np.argwhere(mapped.costs == 254)[50] + [0, 0, 1]
    assert mapped.distances[tuple(beside)] <= mapped.resolution


def test_points_are_where_beams_ended(episode):
    points = episode.points_at(3)
    assert points.shape[1] == 3
    low, high = np.array(episode.log.mission.low), np.array(episode.log.mission.high)
    within = ((points > low - 0.5) & (points < high + 0.5)).all(axis=1)
    assert within.mean() > 0.9


def test_a_decision_that_is_not_there_is_named(episode):
    last = len(episode.decisions()) - 1
    with pytest.raises(wayproof.InputError, match=f"got decision 999, expected 0 to {last}"):
        episode.map_at(999)


def test_a_study_runs_is_a_table_with_its_logs_and_is_compared(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("s.toml").write_text(
        'name = "s"\nworlds = ["empty"]\nrobots = ["drone"]\nseeds = 2\n'
        '[set]\n"episode.time_limit" = 0.3\n"map.resolution" = 0.2\n'
        "[perturbations]\npose_drift = [3]\n"
    )
    study = wayproof.study("s.toml")
    assert study.folder == Path("logs/s")
    rows = study.table().to_pylist()
    assert len(rows) == 4
    assert {row["perturbation"] for row in rows} == {"none", "pose_drift"}
    for row in rows:
        assert study.episode(row["key"]).outcome == row["outcome"] == "timeout"
        assert wayproof.open(row["log"]).metrics()["ate"] == row["ate"]
    assert study.result().verdict == "complete"
    assert len(study.result().lost) == 4
    other = wayproof.study("s.toml", settings={"map.resolution": 0.25}, out="logs/other")
    compared = other.compare(wayproof.study("logs/s"), gates=["success.drop <= 0.5"])
    assert compared.verdict == "inconclusive"
    assert {row["metric"] for row in compared.changes.to_pylist()} >= {"success", "least_clearance"}
    assert {row["gate"].split(" ")[0] for row in compared.gates.to_pylist()} == {"success.drop"}
    with pytest.raises(wayproof.InputError, match="'nowhere'"):
        wayproof.study("nowhere")
