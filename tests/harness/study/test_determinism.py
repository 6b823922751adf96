"""A sample of a study run again in other ways, and what its certificate says."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from wayproof.harness.cli.main import main
from wayproof.harness.runner import run_episode
from wayproof.harness.scenario.scenario import build
from wayproof.harness.study.determinism import ARRANGEMENTS, certify, draw
from wayproof.harness.study.file import StudyFile, read_study
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.store import Store

STUDY = """
name = "again"
worlds = ["empty"]
robots = ["drone"]
seeds = 1
[set]
"episode.time_limit" = 1
"map.resolution" = 0.2
"""


def test_a_certificate_tells_of_a_chain_that_differs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """All are alike, until a finished log is replaced by that of another episode."""
    path, out = tmp_path / "study.toml", tmp_path / "out"
    path.write_text(STUDY)
    words = ["study", str(path), "--out", str(out), "--jobs", "1", "--check-determinism", "--json"]
    assert main(words) == 0
    certificate = json.loads(capsys.readouterr().out)["determinism"]
    kept = json.loads((out / "determinism.json").read_text())
    assert certificate == kept
    assert kept["identical"]
    assert [one["arrangement"] for one in kept["reruns"]] == [one.name for one in ARRANGEMENTS]
    assert kept["versions"]["mujoco"]
    study = read_study(str(path))
    [planned] = plan_episodes(study)
    store = Store(out)
    run_episode(build(replace(planned.config, seed=5)), store.log(planned.key))
    certificate = certify(
        "again", [planned], store, study.bounds, lambda done: None, arrangements=ARRANGEMENTS[1:2]
    )
    assert not certificate.identical
    assert not json.loads((out / "determinism.json").read_text())["identical"]
    assert [one.chain for one in certificate.reruns] == [kept["reruns"][1]["chain"]]


def test_a_sample_has_some_of_every_arm() -> None:
    study = StudyFile(
        name="x",
        worlds=["empty", "office"],
        robots=["drone"],
        seeds=30,
        perturbations={"rate": [1.0]},
    )
    planned = plan_episodes(study)
    drawn = draw(planned, 8)
    assert len({one.key for one in drawn}) == 8
    assert [sum(one.arm == arm for one in drawn) for arm in {one.arm for one in planned}] == [2] * 4
    assert draw(list(reversed(planned)), 8) == drawn
    assert len(draw(planned[:3], 8)) == 3
