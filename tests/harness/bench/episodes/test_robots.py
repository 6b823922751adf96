import math

import pytest

from wayproof.harness.bench.episodes import robots as bench_robots
from wayproof.harness.bench.episodes.robots import CASES, Case, Run, run_cases, run_once, summarise


def test_cases_have_names_of_their_own():
    assert len({(case.robot, case.name) for case in CASES}) == len(CASES)


def test_a_row_by_hand():
    case = Case("quadruped", "hops", 1, lambda rng: Run(False))
    runs = [
        Run(False, True, (0.3, 0.0, 0.1), 0.03, 0.5, 0.001, 10.0),
        Run(False, False, (0.4, 0.0, 0.1), 0.04, 0.7, 0.003, 20.0),
        Run(True, False, (9.0, 9.0, 9.0), 9.0, 9.0, 9.0, 9.0),
    ]
    row = summarise(case, runs)
    assert (row.runs, row.falls, row.crossed) == (3, 1, 1)
    assert row.rms_vx == pytest.approx(math.sqrt(0.125))
    assert (row.rms_vy, row.rms_wz) == pytest.approx((0.0, 0.1))
    assert row.rmse_m == pytest.approx(math.sqrt(0.00125))
    assert (row.stop_m, row.creep_mm, row.energy_j) == pytest.approx((0.7, 3.0, 15.0))
    assert row.realtime_factor is None


def test_figures_that_do_not_apply_are_null():
    row = summarise(CASES[0], [Run(True, errors=(math.nan, math.nan, math.nan))])
    assert (row.runs, row.falls) == (1, 1)
    assert row.rms_vx is row.rmse_m is row.crossed is None


def test_runs_are_the_same_in_any_process():
    lines = []
    number = next(n for n, case in enumerate(CASES) if case.name == "hover, gusts")
    found = run_cases(1, 5, lines.append, names={"hover, gusts"})
    assert found[number] == [run_once(5, number, 0)]
    assert sum(map(len, found)) == 1
    assert lines == ["robots: 1 of 1 runs, 0 falls"]
    assert run_once(5, number, 1) != run_once(5, number, 0)
    assert run_once(6, number, 0) != run_once(5, number, 0)


def test_robots_are_faster_than_their_time(monkeypatch):
    monkeypatch.setattr(bench_robots, "SPEED_TIME", 1.0)
    rows = bench_robots.speed_rows()
    assert [row.robot for row in rows] == ["quadruped", "drone"]
    assert all(row.realtime_factor > 3.0 for row in rows)
