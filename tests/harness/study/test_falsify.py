"""A search finds what was planted, sooner than chance does, and cuts its trigger down."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec
import numpy as np
import pytest

from wayproof.harness.cli.main import main
from wayproof.harness.config import Config
from wayproof.harness.config_document import from_json, override
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.writer import LogWriter
from wayproof.harness.perturbations import AnyPerturbation, perturbation_from
from wayproof.harness.scenario.scenario import build
from wayproof.harness.study.contents import contents_of
from wayproof.harness.study.falsify import Falsification, Hunt, Space, falsification_of
from wayproof.harness.study.file import FalsifyOptions, StudyFile, read_study
from wayproof.harness.study.job import Done, Job
from wayproof.harness.study.plan import Planned, plan_episodes
from wayproof.harness.study.processes import Finished
from wayproof.harness.study.search import Steps, Trial
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import Engine, answers_of, run_missing

MISSION = build(Config("empty", "drone", 0)).mission.to_json()
JUMPS = Space("pose_jump", latest=4.0, length=1.0)
STUDY = StudyFile(
    name="fall",
    kind="falsify",
    worlds=["empty"],
    robots=["drone"],
    seeds=[1],
    perturbations={"pose_jump": []},
    falsify=FalsifyOptions(window=1.0, budget=60),
)
[EPISODE] = plan_episodes(STUDY)


def driven(steps: Steps, evaluate: Callable[[AnyPerturbation], Trial]) -> list[Trial]:
    """Answer what a search asks for; return all trials."""
    ran: list[Trial] = []
    asked = next(steps, None)
    while asked is not None:
        trials = [evaluate(one) for one in asked if one is not None]
        ran += trials
        try:
            asked = steps.send(trials)
        except StopIteration:
            return ran
    return ran


def gap_of(one: AnyPerturbation) -> Trial:
    """A stack that fails in one corner of (when, how strongly, where), 0.17 % of the space.

    Its robustness is the distance from that corner, in parts of the space.
    """
    assert one.window is not None
    direction = getattr(one, "direction", 0.0)
    gap = np.abs([one.window[0] - 1.7, one.severity - 4.0, direction - 120.0]) / [4.0, 5.0, 360]
    return Trial(one, bool((gap < 0.06).all()), float(np.linalg.norm(gap)))


def test_a_planted_weakness_is_found_where_chance_needs_more() -> None:
    low, high = JUMPS.ends
    for seed in range(10):
        hunt = Hunt(EPISODE, "pose_jump", FalsifyOptions(seed=seed))
        driven(hunt.search(JUMPS), gap_of)
        assert hunt.failing is not None
        assert hunt.episodes <= 100
    points = np.random.default_rng(0).uniform(low, high, (2000, len(low))).tolist()
    drawn = sum(gap_of(JUMPS.perturbation(point)).failed for point in points)
    assert drawn < 10  # one in 600


def test_a_budget_is_kept_and_the_nearest_returned() -> None:
    hunt = Hunt(EPISODE, "pose_jump", FalsifyOptions(budget=30, seed=1))
    ran = driven(hunt.search(JUMPS), lambda one: Trial(one, False, one.severity))
    assert (hunt.episodes, len(ran), hunt.failing) == (30, 30, None)
    assert hunt.nearest is not None
    assert hunt.nearest.clearance == min(one.clearance for one in ran)


def test_a_trigger_is_cut_down_to_its_window() -> None:
    """The stack fails if it is off at 1.80 s: of a window of 1.7 to 2.7 s a tenth is left."""

    def off_at(one: AnyPerturbation) -> Trial:
        assert one.window is not None
        return Trial(one, one.window[0] <= 1.8 < one.window[1], 0.0)

    whole = off_at(JUMPS.perturbation([1.7, 4.0, 0.0]))
    assert whole.failed
    hunt = Hunt(EPISODE, "pose_jump", FalsifyOptions(), failing=whole, shortest=whole)
    driven(hunt.shorten(), off_at)
    assert hunt.shortest is not None
    assert hunt.shortest.failed
    assert hunt.shortest.perturbation is not None
    assert hunt.shortest.perturbation.window is not None
    begin, end = hunt.shortest.perturbation.window
    assert begin <= 1.8 < end <= begin + 0.1
    assert hunt.cuts <= 10


def test_points_are_perturbations_within_the_bounds() -> None:
    one = JUMPS.perturbation([4.0004, 5.004, -180.004])
    assert (one.window, one.severity, one.direction) == ((4.0, 5.0), 5, -180.0)  # type: ignore[union-attr]
    assert list(Space("rate", 4.0, 1.0).parameters) == ["begin", "severity"]


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
        with LogWriter(job.log, job.config, MISSION, "<mujoco/>") as log:
            log.finish(result)
        finished(Done(job.key))


def refuse(jobs: Sequence[Job], *_: object) -> None:
    """An engine for what needs none."""
    raise AssertionError(f"{len(jobs)} episodes run again")


def falsified(folder: Path, engine: Engine, study: StudyFile = STUDY) -> Falsification:
    store = Store(folder)

    def run(some: Sequence[Planned]) -> None:
        run_missing(some, store, engine, lambda done: None)

    with store.open():
        [found] = answers_of(study, plan_episodes(study), store, contents_of([]), run=run)
    assert isinstance(found, Falsification)
    return found


def test_a_failing_log_is_named_and_the_one_of_the_shortest_window(tmp_path: Path) -> None:
    found = falsified(tmp_path, pretended)
    assert found.exit_code == 1
    assert found.failing is not None
    assert found.shortest is not None
    assert (found.failing.outcome, found.failing.reason) == ("fall", "tilted")
    assert found.episodes + found.cuts + 1 >= len(list((tmp_path / "logs").glob("*.mcap")))
    for tried in (found.failing, found.shortest):
        assert open_log(Path(tried.log)).config.perturbation == tried.perturbation
    assert found.shortest.perturbation is not None
    window = found.shortest.perturbation.window
    assert window is not None
    assert window[0] <= 2.0 < window[1] <= window[0] + 0.1
    setting = override(EPISODE.config, [f"perturbation={found.setting}"])
    assert setting.perturbation == found.shortest.perturbation
    assert falsified(tmp_path, refuse) == found


def test_a_search_that_finds_nothing_tells_the_nearest(tmp_path: Path) -> None:
    options = FalsifyOptions(window=1.0, budget=10)
    study = msgspec.structs.replace(STUDY, perturbations={"latency": []}, falsify=options)
    found = falsified(tmp_path, pretended, study)
    assert (found.failing, found.episodes, found.exit_code) == (None, 10, 0)
    assert found.nearest is not None
    assert found.nearest.clearance == 0.5


def test_a_search_that_finds_nothing_says_where_its_clearance_is_a_bound() -> None:
    for least, said in ((1.5, "clearance 1.50 m with"), (2.0, "clearance >= 2.00 m with")):
        nearest = Trial(perturbation_from("pose_jump:1"), False, least)
        hunt = Hunt(EPISODE, "pose_jump", FalsifyOptions(), 3, nearest, ended=True)
        words = falsification_of(hunt).in_words()
        assert said in words
        assert "no rate follows" in words


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        (["perturbations=pose_jump:5"], "the search chooses the severity"),
        (["perturbations=slip"], "acts all the time"),
        (["falsify.greatest=0"], "Expected `float` > 0.05"),
        (["kind=threshold", "perturbations.rate:3=[]"], "rate:3': the search chooses"),
        (["perturbations={}"], "no \\[perturbations\\] to search"),
        (["worlds"], "expected NAME=VALUE"),
    ],
)
def test_what_is_looked_for_is_not_given(settings: list[str], said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_study("falsify", settings=settings)


def test_a_study_of_this_kind_says_what_it_cannot_search(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = "worlds=empty seeds=[1] perturbations=latency falsify.budget=1 goal=[5.4,1.65]".split()
    settings = [part for word in words for part in ("--set", word)]
    settings += ["--jobs", "1", "--out", str(tmp_path / "out"), "--json"]
    assert main(["study", "falsify", "--set", "episode.time_limit=1", *settings]) == 3
    [found] = json.loads(capsys.readouterr().out)["answers"]
    assert "nothing to search for" in found["error"]
    assert main(["study", "falsify", "--set", "falsify.greatest=0.1", *settings]) == 0
    [found] = json.loads(capsys.readouterr().out)["answers"]
    assert (found["episodes"], found["failing"]) == (1, None)
    assert main(["report", str(tmp_path / "out")]) == 0
    assert "Falsification" in (tmp_path / "out" / "report.html").read_text()
