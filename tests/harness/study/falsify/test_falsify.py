"""A search finds what was planted, sooner than chance does, and cuts its trigger down."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from wayproof.harness.cli.main import main
from wayproof.harness.config import Config
from wayproof.harness.config_document import from_json, override, to_json
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.writer import LogWriter
from wayproof.harness.scenario.scenario import build
from wayproof.harness.study.falsify.falsify import Task, falsify
from wayproof.harness.study.job import Done, Job
from wayproof.harness.study.processes import Finished
from wayproof.harness.study.store import Store

MISSION = build(Config("empty", "drone", 0)).mission.to_json()


def pretended(jobs: Sequence[Job], stacks: Sequence[bytes], finished: Finished) -> None:
    """An engine whose episodes of 4 s fall if the pose is off by 0.3 m or more at 2 s."""
    for job in jobs:
        config = from_json(job.config)
        one = config.perturbation
        off = one is not None and one.amount >= 0.3 and one.is_active(2 * 10**9)
        result = {
            "outcome": "fall" if off else "success",
            "reason": "tilted" if off else "there",
            "chain": "",
            "sim_time_s": "4.0",
            "min_clearance_m": "0.1" if off else "0.5",
        }
        in_its_world = replace(config, motion=replace(config.motion, limits="full"))
        with LogWriter(job.log, to_json(in_its_world), MISSION, "<mujoco/>") as log:
            log.finish(result)
        finished(Done(job.key))


def test_a_failing_log_is_kept_and_the_one_of_the_shortest_window(tmp_path: Path) -> None:
    task = Task(Config("empty", "drone", 1), "pose_jump", 1.0, 5.0, 60, 0)
    found = falsify(task, Store(tmp_path), pretended, lambda done: None)
    assert (found.outcome, found.reason) == ("fall", "tilted")
    assert found.failing is not None
    assert found.shortest is not None
    assert found.episodes + found.cuts + 1 >= len(list((tmp_path / "logs").glob("*.mcap")))
    for path, tried in ((found.log, found.failing), (found.shortest_log, found.shortest)):
        assert open_log(Path(path)).config.perturbation == tried.perturbation
    window = found.shortest.perturbation.window
    assert window is not None
    assert window[0] <= 2.0 < window[1] <= window[0] + 0.1
    setting = override(task.config, [f"perturbation={found.setting}"])
    assert setting.perturbation == found.shortest.perturbation
    again = falsify(task, Store(tmp_path), refuse, lambda done: None)
    assert again == found


def refuse(jobs: Sequence[Job], *_: object) -> None:
    """An engine for what needs none."""
    raise AssertionError(f"{len(jobs)} episodes run again")


def test_a_search_that_finds_nothing_tells_the_nearest(tmp_path: Path) -> None:
    task = Task(Config("empty", "drone", 1), "latency", 1.0, 5.0, 10, 0)
    found = falsify(task, Store(tmp_path), pretended, lambda done: None)
    assert (found.failing, found.episodes, found.log) == (None, 10, "")
    assert found.nearest.robustness == 0.5


def test_the_verb_says_that_no_rate_follows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = "falsify empty --robot drone --seed 1 --perturb latency --budget 1 --jobs 1".split()
    settings = ["--set", "goal=[5.4, 1.65]", "--out", str(tmp_path / "out"), "--json"]
    assert main([*words, "--set", "episode.time_limit=1", *settings]) == 2
    assert "there is nothing to search for" in capsys.readouterr().err
    assert main([*words, "--greatest", "0.1", *settings]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["episodes"], document["failing"], document["rate"]) == (1, None, None)
    assert "no rate follows" in document["note"]
