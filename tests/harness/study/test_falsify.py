"""A search finds what was planted, sooner than chance does, and cuts its trigger down."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np
import pytest

from tests.harness.study.here import answer, pretend, refuse
from wayproof.harness.cli.main import main
from wayproof.harness.config_document import from_json, override
from wayproof.harness.log.reader import open_log
from wayproof.harness.perturbations import AnyPerturbation, perturbation_from
from wayproof.harness.study.falsify import Hunt, Space, falsification_of
from wayproof.harness.study.file import FalsifyOptions, StudyFile
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.search import Steps, Trial

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
    assert hunt.shortest.failed
    begin, end = hunt.shortest.perturbation.window
    assert begin <= 1.8 < end <= begin + 0.1
    assert hunt.cuts <= 10


def test_points_are_perturbations_within_the_bounds() -> None:
    one = JUMPS.perturbation([4.0004, 5.004, -180.004])
    assert (one.window, one.severity, one.direction) == ((4.0, 5.0), 5, -180.0)  # type: ignore[union-attr]
    assert list(Space("rate", 4.0, 1.0).parameters) == ["begin", "severity"]


def pretended(jobs, stacks, finished):
    """An engine whose episodes of 4 s fall if the pose is off by 0.3 m or more at 2 s."""
    for job in jobs:
        one = from_json(job.config).perturbation
        off = one is not None and one.amount >= 0.3 and one.is_active(2 * 10**9)
        outcome, clearance = ("fall", "0.1") if off else ("success", "0.5")
        finished(pretend(job, outcome, sim_time_s="4.0", min_clearance_m=clearance))


def test_a_failing_log_is_named_and_the_one_of_the_shortest_window(tmp_path: Path) -> None:
    found = answer(STUDY, tmp_path, pretended)
    assert found.exit_code == 1
    assert (found.failing.outcome, found.failing.reason) == ("fall", "fall")
    assert found.episodes + found.cuts + 1 >= len(list((tmp_path / "logs").glob("*.mcap")))
    for tried in (found.failing, found.shortest):
        assert open_log(Path(tried.log)).config.perturbation == tried.perturbation
    window = found.shortest.perturbation.window
    assert window[0] <= 2.0 < window[1] <= window[0] + 0.1
    setting = override(EPISODE.config, [f"perturbation={found.setting}"])
    assert setting.perturbation == found.shortest.perturbation
    assert answer(STUDY, tmp_path, refuse) == found


def test_a_search_that_finds_nothing_tells_the_nearest(tmp_path: Path) -> None:
    options = FalsifyOptions(window=1.0, budget=10)
    study = msgspec.structs.replace(STUDY, perturbations={"latency": []}, falsify=options)
    found = answer(study, tmp_path, pretended)
    assert (found.failing, found.episodes, found.exit_code) == (None, 10, 0)
    assert found.nearest.clearance == 0.5


def test_a_search_that_finds_nothing_says_where_its_clearance_is_a_bound() -> None:
    for least, said in ((1.5, "clearance 1.50 m with"), (2.0, "clearance >= 2.00 m with")):
        nearest = Trial(perturbation_from("pose_jump:1"), False, least)
        hunt = Hunt(EPISODE, "pose_jump", FalsifyOptions(), 3, nearest, ended=True)
        words = falsification_of(hunt).in_words()
        assert said in words
        assert "no rate follows" in words


@pytest.mark.usefixtures("in_this_process")
def test_a_study_of_this_kind_says_what_it_cannot_search(tmp_path, capsys):
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
