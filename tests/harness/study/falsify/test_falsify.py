"""A search finds what was planted, sooner than chance does, and cuts its trigger down."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest

from wayproof.harness.bench.episodes.glass_pole import SPACE, cross_pole_room
from wayproof.harness.cli.main import main
from wayproof.harness.config import Config, from_json, override
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.log.writer import LogWriter
from wayproof.harness.perturbations import AnyPerturbation
from wayproof.harness.scenario.scenario import build
from wayproof.harness.study.falsify.falsify import Task, falsify
from wayproof.harness.study.falsify.search import Trial, search, shorten
from wayproof.harness.study.falsify.space import Space
from wayproof.harness.study.job import Done, Job
from wayproof.harness.study.processes import Finished
from wayproof.harness.study.store import Store

JUMPS = Space("pose_jump", latest=4.0, length=1.0)
MISSION = build(Config("empty", "drone", 0)).mission.to_json()


def weak(perturbations: Sequence[AnyPerturbation]) -> Iterator[Trial]:
    """A stack that fails in one corner of (when, how strongly, where), 0.17 % of the space.

    Its robustness is the distance from that corner, in parts of the space.
    """
    for one in perturbations:
        assert one.window is not None
        direction = getattr(one, "direction", 0.0)
        gap = np.abs([one.window[0] - 1.7, one.severity - 4.0, direction - 120.0]) / [4.0, 5.0, 360]
        yield Trial(one, bool((gap < 0.06).all()), float(np.linalg.norm(gap)))


def test_a_planted_weakness_is_found_where_chance_needs_more() -> None:
    evolved = [search(JUMPS, weak, 100, seed) for seed in range(10)]
    drawn = [search(JUMPS, weak, 2000, seed, "random") for seed in range(10)]
    assert all(one.failing is not None for one in evolved)
    assert max(one.episodes for one in evolved) <= 100
    assert sum(one.episodes > 100 for one in drawn) >= 9
    found = zip(evolved, drawn, strict=True)
    assert sum(ours.episodes < random.episodes for ours, random in found) >= 9


def test_a_budget_is_kept_and_the_nearest_told() -> None:
    ran: list[Trial] = []

    def noted(perturbations: Sequence[AnyPerturbation]) -> Iterator[Trial]:
        for one in perturbations:
            ran.append(Trial(one, False, one.severity))
            yield ran[-1]

    result = search(JUMPS, noted, 30, 1)
    assert (result.episodes, len(ran), result.failing) == (30, 30, None)
    assert result.nearest.robustness == min(one.perturbation.severity for one in ran)
    assert search(JUMPS, noted, 30, 1).nearest == result.nearest
    with pytest.raises(InputError, match="unknown method 'luck'"):
        search(JUMPS, noted, 30, 1, "luck")


def test_a_trigger_is_cut_down_to_its_window() -> None:
    """The stack fails if it is off at 1.80 s: of a window of 1.7 to 2.7 s a tenth is left."""

    def off_at(perturbations: Sequence[AnyPerturbation]) -> Iterator[Trial]:
        for one in perturbations:
            assert one.window is not None
            yield Trial(one, one.window[0] <= 1.8 < one.window[1], 0.0)

    [whole] = off_at([JUMPS.perturbation([1.7, 4.0, 0.0])])
    assert whole.failed
    shortest, episodes = shorten(whole, off_at)
    assert shortest.failed
    assert shortest.perturbation.window is not None
    begin, end = shortest.perturbation.window
    assert begin <= 1.8 < end <= begin + 0.1
    assert episodes <= 10


def test_points_are_perturbations_within_the_bounds() -> None:
    one = JUMPS.perturbation([4.0004, 5.004, -180.004])
    assert (one.window, one.severity, one.direction) == ((4.0, 5.0), 5, -180.0)  # type: ignore[union-attr]
    assert list(Space("rate", 4.0, 1.0).parameters) == ["begin", "severity"]


def test_the_pole_is_hit_by_the_jump_that_leads_there_alone() -> None:
    """Off to its side when it passes; off to the other side, or later, it is safe."""
    there, other, late = (
        SPACE.perturbation(point)
        for point in [(1.5, 3.5, -90.0), (1.5, 3.5, 90.0), (3.5, 3.5, -90.0)]
    )
    hit, *safe = cross_pole_room([there, other, late])
    assert hit.failed
    assert [one.failed for one in safe] == [False, False]


def pretended(jobs: Sequence[Job], stacks: Sequence[bytes], finished: Finished) -> None:
    """An engine whose episodes of 4 s fall if the pose is off by 0.3 m or more at 2 s."""
    for job in jobs:
        one = from_json(job.config).perturbation
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


def test_a_failing_log_is_kept_and_the_one_of_the_shortest_window(tmp_path: Path) -> None:
    asked = Task(Config("empty", "drone", 1), "pose_jump", 1.0, 5.0, 60, 0)
    found = falsify(asked, Store(tmp_path), pretended, lambda done: None)
    assert (found.outcome, found.reason) == ("fall", "tilted")
    assert found.failing is not None
    assert found.shortest is not None
    assert found.episodes + found.cuts + 1 >= len(list((tmp_path / "logs").glob("*.mcap")))
    for path, tried in ((found.log, found.failing), (found.shortest_log, found.shortest)):
        assert open_log(Path(path)).config.perturbation == tried.perturbation
    window = found.shortest.perturbation.window
    assert window is not None
    assert window[0] <= 2.0 < window[1] <= window[0] + 0.1
    setting = override(asked.config, [f"perturbation={found.setting}"])
    assert setting.perturbation == found.shortest.perturbation
    again = falsify(asked, Store(tmp_path), refuse, lambda done: None)
    assert again == found


def refuse(jobs: Sequence[Job], *_: object) -> None:
    """An engine for what needs none."""
    raise AssertionError(f"{len(jobs)} episodes run again")


def test_a_search_that_finds_nothing_tells_the_nearest(tmp_path: Path) -> None:
    asked = Task(Config("empty", "drone", 1), "latency", 1.0, 5.0, 10, 0)
    found = falsify(asked, Store(tmp_path), pretended, lambda done: None)
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
