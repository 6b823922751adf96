import math

import pytest

from tests.tools.trials.robots import CASES, Case, run_cases, run_once, summarise
from tests.tools.trials.run import Run


def test_a_row_by_hand():
    case = Case("quadruped", "hops", 1, lambda rng: Run(False))
    runs = [
        Run(False, 1.0, True, (0.3, 0.0, 0.1), 0.03, 0.5, 0.001, None, 10.0),
        Run(False, 1.0, False, (0.4, 0.0, 0.1), 0.04, 0.7, 0.003, None, 20.0),
        Run(True, 1.0, False, (9.0, 9.0, 9.0), 9.0, 9.0, 9.0, None, 9.0),
    ]
    row = summarise(case, runs)
    assert (row["runs"], row["falls"], row["crossed"]) == (3, 1, 1)
    assert row["vx"] == pytest.approx(math.sqrt(0.125))
    assert (row["vy"], row["wz"]) == pytest.approx((0.0, 0.1))
    assert row["rmse_m"] == pytest.approx(math.sqrt(0.00125))
    assert (row["stop_m"], row["creep_mm"], row["energy_j"]) == pytest.approx((0.7, 3.0, 15.0))


@pytest.mark.large
def test_runs_are_the_same_in_any_process():
    number = next(n for n, case in enumerate(CASES) if case.name == "hover, gusts")
    [(case, runs)] = run_cases(1, 5, print, only="hover, gusts")
    assert (case.name, runs) == ("hover, gusts", [run_once(5, number, 0)])
    assert run_once(5, number, 1) != run_once(5, number, 0)
