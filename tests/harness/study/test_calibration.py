"""The smallest margin under a bound, from hand-made rows and from real episodes."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

from wayproof.harness.cli.main import main
from wayproof.harness.errors import InputError
from wayproof.harness.metrics import METRICS
from wayproof.harness.study.calibration import SETTING, margin_from, margin_study
from wayproof.harness.study.plan import Arm, plan_episodes
from wayproof.harness.study.rows import Row


def rows(collided: int, count: int = 100, time: float = 20.0) -> list[Row]:
    """The first so many collide."""
    arm = Arm("warehouse", "drone", "", "none", 0)
    usual = dict.fromkeys(METRICS)
    made = []
    for seed in range(count):
        hit = seed < collided
        metrics = {**usual, "success": float(not hit), "collisions": float(hit)}
        outcome = "collision" if hit else "success"
        made.append(Row(str(seed), arm, seed, outcome, "", "", "", time, metrics, ()))
    return made


def test_the_smallest_margin_is_read_off_fitted_rates() -> None:
    """Rates of 40, 6, 8 and 0 %: 6 and 8 are fitted to 7 each; shown to hold is the last alone."""
    margins = [0.0, 0.1, 0.2, 0.3]
    ladder = [rows(40), rows(6), rows(8), rows(0, time=25.0)]
    result = margin_from(margins, ladder, 60.0, 0.02, 0.07)
    assert [one.monotone for one in result.rungs] == pytest.approx([0.4, 0.07, 0.07, 0.0])
    assert (result.margin, result.low, result.high) == (0.1, 0.1, 0.3)
    assert result.seeds_to_show == 51  # 0.93^51 < 2.5 % < 0.93^50
    assert result.rungs[-1].collided.high == pytest.approx(1 - 0.025 ** (1 / 100))
    first, last = result.rungs[0], result.rungs[-1]
    assert first.success_price.estimate == first.time_price.estimate == 0.0
    assert last.success_price.estimate == pytest.approx(0.4)
    # 60 pairs go from 20 to 25 s, 40 from the limit of 60 to 25.
    assert last.time_price.estimate == pytest.approx(0.6 * 5 + 0.4 * -35)
    assert last.time_price.low < last.time_price.estimate < last.time_price.high


def test_too_few_episodes_show_nothing() -> None:
    result = margin_from([0.0, 0.1], [rows(1, 10), rows(0, 10)], 60.0, 0.02, 0.05)
    assert (result.margin, result.low, result.high) == (0.1, 0.0, None)


def test_an_episode_in_error_has_not_kept_clear() -> None:
    broken = [dataclasses.replace(row, outcome="error") for row in rows(0, 10)]
    result = margin_from([0.0, 0.1], [broken, broken], 60.0, 0.02, 0.05)
    assert (result.margin, result.low, result.high) == (None, None, None)


def test_a_drift_is_a_severity_in_between() -> None:
    study = margin_study("warehouse", "drone", 3, 0.0125, [0.2, 0.1], {"difficulty": 0.4})
    planned = plan_episodes(study)
    assert len(planned) == 6
    assert {one.config.perturbation.amount for one in planned if one.config.perturbation} == {
        0.0125
    }
    assert study.axes[SETTING] == [0.1, 0.2]
    clean = plan_episodes(margin_study("warehouse", "drone", 3, 0.0, [0.2, 0.1], {}))
    assert {one.config.perturbation for one in clean} == {None}
    with pytest.raises(InputError, match=r"--drift: got 0\.2"):
        margin_study("warehouse", "drone", 3, 0.2, [0.1, 0.2], {})


def test_the_verb_runs_episodes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = "calibrate margin empty --robot drone --drift 0.02 --seeds 2 --margins 0.1,0.2"
    settings = ["--set", "episode.time_limit=1", "--set", "map.resolution=0.2"]
    settings += ["--out", str(tmp_path), "--jobs", "1", "--json"]
    assert main([*words.split(), *settings]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["margin"] == 0.1
    assert [one["collided"]["estimate"] for one in document["rungs"]] == [0.0, 0.0]
    assert [one["time"] for one in document["rungs"]] == [1.0, 1.0]
    assert document["high"] is None
