"""Intervals of means by hand, and where they are hard: few worlds, no event, all alike."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.tools.statistics.coverage import STATISTICS, Data, coverage_of
from wayproof.harness.metrics import METRICS
from wayproof.harness.statistics.intervals import difference_interval, mean_interval
from wayproof.harness.statistics.support import COUNT, MEASURE, RATE, SHARE, TIME, Support

WORLDS = list(range(200))
SUPPORTS = dict.fromkeys(one.support.within(60.0) for one in METRICS.values())


def test_no_failure_in_two_worlds_is_the_exact_interval_of_a_rate() -> None:
    # Clopper and Pearson 1934: 0.025^(1/2).
    interval = mean_interval([1, 1], WORLDS[:2], RATE)
    assert (interval.estimate, interval.high) == (1.0, 1.0)
    assert interval.low == pytest.approx(math.sqrt(0.025))


def test_a_share_between_its_ends_by_hand() -> None:
    # Two values of 0.9: 0.9 (1 - D) and 0.9 + 0.1 D, D the third of three flat Dirichlet weights,
    # whose 97.5 % quantile is 1 - sqrt(0.025).
    weight = 1.0 - math.sqrt(0.025)
    interval = mean_interval([0.9, 0.9], WORLDS[:2], SHARE)
    assert interval.low == pytest.approx(0.9 * (1.0 - weight), abs=0.01)
    assert interval.high == pytest.approx(0.9 + 0.1 * weight, abs=0.001)


def test_no_event_bounds_a_count_from_ten_worlds_on() -> None:
    assert mean_interval([0] * 9, WORLDS[:9], COUNT).high == math.inf
    interval = mean_interval([0] * 50, WORLDS[:50], COUNT)
    assert (interval.low, interval.estimate) == (0.0, 0.0)
    assert interval.high == pytest.approx(1.0 - 0.025 ** (1 / 50))


def test_one_event_refutes_that_there_is_none() -> None:
    interval = mean_interval([0, 1], WORLDS[:2], COUNT)
    assert interval.low > 0.0
    assert interval.high == math.inf


@pytest.mark.parametrize("support", SUPPORTS)
@pytest.mark.parametrize("clusters", [1, 2, 3, 10, 50])
def test_values_that_are_all_alike_leave_a_width(support: Support, clusters: int) -> None:
    value = 0.0 if support.kind == "count" else 0.5
    values = [value] * clusters
    mean = mean_interval(values, WORLDS[:clusters], support)
    change = difference_interval(values, values, WORLDS[:clusters], support)
    assert mean.low < mean.high
    assert change.low < 0.0 < change.high


def test_rounding_is_no_spread() -> None:
    values = np.full(20, 5.95) + 1e-13 * np.arange(20)
    assert mean_interval(values, WORLDS[:20], MEASURE).high == math.inf


def test_few_worlds_show_no_spread_of_a_measure() -> None:
    interval = mean_interval([5.0, 5.1, 4.9, 5.2], WORLDS[:4], MEASURE)
    assert interval.high == math.inf
    assert mean_interval([5.0, 5.1], WORLDS[:2], TIME.within(60.0)).high == pytest.approx(51, abs=1)


def test_a_measure_is_at_least_as_wide_as_students_t() -> None:
    values = np.random.default_rng(0).normal(10.0, 1.0, 12)
    interval = mean_interval(values, WORLDS[:12], MEASURE)
    half = 2.20099 * values.std(ddof=1) / math.sqrt(12)  # t of 11 degrees of freedom
    assert interval.low <= values.mean() - half
    assert interval.high >= values.mean() + half


def test_repeats_in_a_world_are_not_worlds() -> None:
    """Copies of the same pairs narrow nothing, where counting them as new ones would."""
    first, second = np.random.default_rng(1).normal(size=(2, 30))
    once = difference_interval(first, second, WORLDS[:30], MEASURE)
    many = difference_interval(np.tile(first, 9), np.tile(second, 9), WORLDS[:30] * 9, MEASURE)
    assert (many.low, many.high) == pytest.approx((once.low, once.high), rel=1e-9)


def test_a_difference_turns_with_its_sides() -> None:
    first, second = np.random.default_rng(2).poisson([[0.5], [1.5]], (2, 12)).astype(float)
    there = difference_interval(first, second, WORLDS[:12], COUNT)
    back = difference_interval(second, first, WORLDS[:12], COUNT)
    assert (there.low, there.high) == pytest.approx((-back.high, -back.low), rel=0.05)


def test_a_value_beyond_its_declared_support_moves_the_end() -> None:
    late = Support("measure", 0.0, 60.0)
    assert mean_interval([60.2, 60.2], WORLDS[:2], late).high >= 60.2


@pytest.mark.parametrize("clusters", [2, 5, 25])
@pytest.mark.parametrize("data", ["skewed", "rare", "alike"])
@pytest.mark.parametrize("statistic", STATISTICS)
def test_intervals_cover_what_they_promise(statistic: str, data: Data, clusters: int) -> None:
    """At the hard corners; `wayproof bench coverage` has all of them."""
    row = coverage_of(statistic, data, clusters, episodes=1, samples=200, seed=5)
    assert row["coverage"] >= 0.93
    assert row["zero_width"] == 0.0
