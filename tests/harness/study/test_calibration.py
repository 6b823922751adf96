"""The smallest margin under a bound, from hand-made rows and from real episodes."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

from tests.harness.study.here import ARM, row
from wayproof.harness.cli.main import main
from wayproof.harness.study.calibration import Calibration, calibration_of
from wayproof.harness.study.file import read_study
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.rows import Row


def rows(collided: int, count: int = 100, time: float = 20.0) -> list[Row]:
    """The first so many collide."""
    hits = [row(seed, ARM, "collision", collisions=1.0) for seed in range(collided)]
    clear = [row(seed) for seed in range(collided, count)]
    return [replace(one, duration=time) for one in hits + clear]


def calibrated(margins: list[float], ladder: list[list[Row]], bound: float) -> Calibration:
    return calibration_of(ARM, "costmap.localization_margin", margins, ladder, 60.0, bound)


def test_the_smallest_margin_is_read_off_fitted_rates() -> None:
    """Rates of 40, 6, 8 and 0 %: 6 and 8 are fitted to 7 each; shown to hold is the last alone."""
    margins = [0.0, 0.1, 0.2, 0.3]
    ladder = [rows(40), rows(6), rows(8), rows(0, time=25.0)]
    result = calibrated(margins, ladder, 0.07)
    assert [one.monotone for one in result.rungs] == pytest.approx([0.4, 0.07, 0.07, 0.0])
    assert (result.value, result.low, result.high) == (0.1, 0.1, 0.3)
    assert result.seeds_to_show == 51  # 0.93^51 < 2.5 % < 0.93^50
    assert result.rungs[-1].collided.high == pytest.approx(1 - 0.025 ** (1 / 100))
    first, last = result.rungs[0], result.rungs[-1]
    assert first.success_price.estimate == first.time_price.estimate == 0.0
    assert last.success_price.estimate == pytest.approx(0.4)
    # 60 pairs go from 20 to 25 s, 40 from the limit of 60 to 25.
    assert last.time_price.estimate == pytest.approx(0.6 * 5 + 0.4 * -35)
    assert last.time_price.low < last.time_price.estimate < last.time_price.high


def test_too_few_episodes_show_nothing() -> None:
    result = calibrated([0.0, 0.1], [rows(1, 10), rows(0, 10)], 0.05)
    assert (result.value, result.low, result.high) == (0.1, 0.0, None)


def test_an_episode_in_error_has_not_kept_clear() -> None:
    broken = [replace(one, outcome="error") for one in rows(0, 10)]
    result = calibrated([0.0, 0.1], [broken, broken], 0.05)
    assert (result.value, result.low, result.high) == (None, None, None)


def test_every_margin_meets_the_same_drift() -> None:
    planned = plan_episodes(read_study("calibrate", settings=["seeds=3"]))
    assert len(planned) == 6 * 3
    drifts = {one.config.perturbation.amount for one in planned if one.config.perturbation}
    assert drifts == {0.02}


@pytest.mark.usefixtures("in_this_process")
def test_a_study_of_this_kind_runs_episodes(tmp_path, capsys):
    words = "worlds=empty seeds=2 episode.time_limit=1 map.resolution=0.2".split()
    words += ["axes.costmap.localization_margin=[0.1,0.2]"]
    settings = [part for word in words for part in ("--set", word)]
    settings += ["--out", str(tmp_path), "--jobs", "1", "--json"]
    assert main(["study", "calibrate", *settings]) == 0
    [found] = json.loads(capsys.readouterr().out)["answers"]
    assert (found["value"], found["high"]) == (0.1, None)
    assert [one["collided"]["estimate"] for one in found["rungs"]] == [0.0, 0.0]
    assert [one["time"] for one in found["rungs"]] == [1.0, 1.0]
