"""The smallest perturbation at which each seed fails, on engines that need no simulator."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from tests.harness.study.here import HEAD, answer, pretend, written
from wayproof.harness.cli.main import main
from wayproof.harness.config_document import from_json
from wayproof.harness.statistics.exact import quantile_interval
from wayproof.harness.study.contents import contents_of
from wayproof.harness.study.file import StudyFile
from wayproof.harness.study.job import Done, Job
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.processes import Finished
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import answers_of
from wayproof.harness.study.threshold import Thresholds, amount_at, half_in_words

STUDY = StudyFile(
    name="bears",
    kind="threshold",
    worlds=["empty"],
    robots=["drone"],
    seeds=9,
    perturbations={"pose_drift": []},
)
INFINITE = math.inf


class Pretended:
    """An engine whose episodes fail from a severity on that the seed chooses."""

    def __init__(self, bears: Callable[[int], float], most: int = 1000) -> None:
        self.bears = bears
        self.left = most
        self.ran: list[tuple[int, float]] = []

    def __call__(self, jobs: Sequence[Job], stacks: Sequence[bytes], finished: Finished) -> None:
        for job in jobs:
            if self.left == 0:
                raise KeyboardInterrupt
            self.left -= 1
            config = from_json(job.config)
            severity = config.perturbation.severity if config.perturbation else 0.0
            self.ran.append((config.seed, severity))
            outcome = "success" if severity <= self.bears(config.seed) else "collision"
            finished(pretend(job, outcome))


def test_every_seed_is_bracketed_to_a_hundredth(tmp_path: Path) -> None:
    """Seed k fails beyond k/2; seed 0 unperturbed fails at once, none of the others censored."""
    engine = Pretended(lambda seed: seed / 2 if seed else -1.0)
    found = answer(STUDY, tmp_path, engine)
    assert [one.seed for one in found.seeds] == list(range(9))
    assert (found.seeds[0].passed, found.seeds[0].severity) == (-1.0, 0.0)
    for one in found.seeds[1:]:
        assert one.passed <= one.seed / 2 <= one.failed <= one.passed + 0.01
    tries = [sum(one == seed for one, _ in engine.ran) for seed in range(9)]
    assert max(tries) <= STUDY.threshold.episodes
    assert tries[0] == 1
    assert found.episodes == len(engine.ran)
    assert found.median.estimate == pytest.approx(2.0, abs=0.01)
    # Ranks 2 and 8 of 9: the chance of fewer than 2 or more than 7 below the median is 3.9 %.
    assert found.median.low == pytest.approx(0.5, abs=0.01)
    assert found.median.high == pytest.approx(3.5, abs=0.01)
    assert found.median_amount.estimate == pytest.approx(0.005, abs=2e-4)


def test_who_bears_the_whole_scale_is_told_as_such(tmp_path: Path) -> None:
    found = answer(STUDY, tmp_path, Pretended(lambda seed: 9.0 if seed < 6 else 1.0))
    assert found.episodes == 6 * 2 + 3 * 11
    assert found.median.estimate == INFINITE
    assert found.median.high == INFINITE
    assert found.median.low == pytest.approx(1.0, abs=0.01)
    assert re.fullmatch(
        r"9 seeds in 45 episodes: half fail only beyond the scale \(interval from severity "
        r"\S+, \S+ m/m, to beyond the scale\); 6 bear even 5; 0 fail .*",
        found.in_words(),
    )


@pytest.mark.parametrize(
    ("severities", "words"),
    [
        ([2.0] * 9, "half fail at severity 2 (2 to 2), 2 (2 to 2) m"),
        ([2.0] * 5, "half fail at severity 2, 2 m (too few seeds for an interval)"),
        ([INFINITE] * 2, "half fail only beyond the scale (too few seeds for an interval)"),
        ([INFINITE] * 9, "half fail only beyond the scale"),
        (
            [2.0] * 5 + [INFINITE] * 4,
            "half fail at severity 2, 2 m (interval from severity 2, 2 m, to beyond the scale)",
        ),
    ],
)
def test_where_half_fail_is_a_sentence(severities: list[float], words: str) -> None:
    median = quantile_interval(severities)
    assert f"half fail {half_in_words(median, median, 'm')}" == words


def test_what_was_interrupted_goes_on(tmp_path: Path) -> None:
    whole = Pretended(lambda seed: seed / 3)
    expected = answer(STUDY, tmp_path / "whole", whole)
    first = Pretended(lambda seed: seed / 3, most=25)
    with pytest.raises(KeyboardInterrupt):
        answer(STUDY, tmp_path / "parts", first)
    store = Store(tmp_path / "parts")
    [halfway] = answers_of(STUDY, plan_episodes(STUDY), store, contents_of([]))
    assert isinstance(halfway, Thresholds)
    assert (halfway.unfinished, halfway.episodes) == (9, 25)
    rest = Pretended(lambda seed: seed / 3)
    assert answer(STUDY, tmp_path / "parts", rest) == expected
    assert sorted(first.ran + rest.ran) == sorted(whole.ran)


def test_an_episode_that_cannot_be_run_is_no_failure(tmp_path: Path) -> None:
    def engine(jobs: Sequence[Job], stacks: Sequence[bytes], finished: Finished) -> None:
        for job in jobs:
            finished(Done(job.key, "no such file"))

    found = answer(STUDY, tmp_path, engine)
    assert found.errors == list(range(9))
    assert (found.seeds, found.median) == ([], None)
    assert found.in_words().endswith("9 could not be run, first: no such file")


def test_amounts_at_the_ends_of_the_scale() -> None:
    assert amount_at("pose_drift", 0.0) == 0.0
    assert amount_at("rate", 0.0) == 1.0
    assert amount_at("calibration:translation", 2.5) == 0.75
    assert amount_at("rate", INFINITE) == INFINITE


def test_a_quantiles_interval_covers_it() -> None:
    """95 % or more of 2000 samples of 20, whatever the law; and by hand for 5."""
    generator = np.random.default_rng(5)
    samples = generator.exponential(size=(2000, 20))
    found = [quantile_interval(sample) for sample in samples]
    covered = np.mean([one.low <= math.log(2.0) <= one.high for one in found])
    assert 0.95 <= covered <= 0.975
    few = quantile_interval([3.0, 1.0, 2.0, 5.0, 4.0])  # all five below by chance: 1 in 32
    assert (few.low, few.estimate, few.high) == (-INFINITE, 3.0, INFINITE)


@pytest.mark.usefixtures("in_this_process")
def test_a_study_of_this_kind_bisects_real_episodes(tmp_path, capsys):
    """A limit of 1 s makes every episode fail unperturbed: one each, and a page that says so."""
    rest = 'seeds = 1\n[set]\n"map.resolution" = 0.2\n[perturbations]\npose_jump = [1]\n'
    path, out = written(tmp_path, HEAD + rest), str(tmp_path / "out")
    words = ["study", path, "--set", "kind=threshold", "--set", "episode.time_limit=1"]
    assert main([*words, "--out", out, "--jobs", "1", "--json"]) == 0
    [found] = json.loads(capsys.readouterr().out)["answers"]
    assert found["episodes"] == 1
    assert [one["severity"] for one in found["seeds"]] == [0.0]
    assert main(["report", out, "--json"]) == 0
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Failure threshold" in page
    assert "1 fail unperturbed" in page
