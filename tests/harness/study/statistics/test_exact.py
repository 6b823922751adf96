"""Intervals and tests against published examples."""

from __future__ import annotations

import pytest

from wayproof.harness.statistics.exact import (
    holm,
    mcnemar,
    paired_rate_difference,
    restricted_mean,
    wilson,
)


def test_wilson_by_hand() -> None:
    # Centre (x + z^2/2) / (n + z^2), half width z / (n + z^2) * sqrt(x (n - x) / n + z^2 / 4),
    # with x = 8, n = 10, z = 1.959964: 0.71675 +- 0.22659.
    interval = wilson(8, 10)
    assert interval.estimate == 0.8
    assert interval.low == pytest.approx(0.49016, abs=1e-5)
    assert interval.high == pytest.approx(0.94332, abs=1e-5)


def test_wilson_of_no_failure_is_not_certain() -> None:
    # n / (n + z^2) = 20 / 23.8415.
    assert wilson(20, 20).low == pytest.approx(0.83887, abs=1e-5)
    assert wilson(20, 20).high == pytest.approx(1.0)


@pytest.mark.parametrize(("successes", "trials"), [(0, 0), (3, 2), (-1, 2)])
def test_wilson_refuses_what_is_no_rate(successes: int, trials: int) -> None:
    with pytest.raises(ValueError, match="trials"):
        wilson(successes, trials)


def test_mcnemar_by_hand() -> None:
    # 1 against 9 of 10 discordant pairs: 2 (C(10,0) + C(10,1)) / 2^10 = 22 / 1024.
    assert mcnemar(1, 9) == pytest.approx(22 / 1024)
    assert mcnemar(9, 1) == pytest.approx(22 / 1024)
    assert mcnemar(0, 0) == 1.0
    assert mcnemar(4, 4) == 1.0


def test_holm_by_hand() -> None:
    # Sorted 0.01 * 4, 0.02 * 3, 0.03 * 2, 0.04 * 1, each at least the one before.
    assert holm([0.04, 0.01, 0.03, 0.02]) == pytest.approx([0.06, 0.04, 0.06, 0.06])
    assert holm([0.6, 0.7]) == [1.0, 1.0]
    assert holm([]) == []


def pairs_of(both: int, only_first: int, only_second: int, neither: int) -> tuple[list[int], ...]:
    first = [1] * (both + only_first) + [0] * (only_second + neither)
    second = [1] * both + [0] * only_first + [1] * only_second + [0] * neither
    return first, second


@pytest.mark.parametrize(
    ("table", "low", "high"),
    [
        # Newcombe 1998, table II, method 10: difference of the first from the second, n = 50.
        ((36, 12, 2, 0), 0.0569, 0.3404),
        ((36, 14, 0, 0), 0.1528, 0.4167),  # one empty margin: no correlation can be told
        ((0, 0, 0, 50), -0.0713, 0.0713),  # no success at all: 3.8415 / 53.8415 either way
    ],
)
def test_paired_rates_against_the_paper(
    table: tuple[int, int, int, int], low: float, high: float
) -> None:
    first, second = pairs_of(*table)
    interval = paired_rate_difference(second, first)  # theirs is the first less the second
    assert interval.low == pytest.approx(low, abs=2e-4)
    assert interval.high == pytest.approx(high, abs=2e-4)


def test_timeouts_count_to_the_limit() -> None:
    """Mean over those who arrived would be 20 s."""
    assert restricted_mean([10.0, 30.0, 47.0], [True, True, False], 60.0) == pytest.approx(100 / 3)
