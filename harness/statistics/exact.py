"""Intervals and tests for rates and for pairs of episodes; scipy does the numerics.

An episode of one seed and its perturbed twin are a pair. Means over worlds are in
`harness.statistics.intervals`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Interval:
    """A confidence interval.

    Attributes:
        estimate: The point estimate, in the unit of what is estimated; finite.
        low: Lower end; -inf where nothing bounds it.
        high: Upper end; inf where nothing bounds it.
    """

    estimate: float
    low: float
    high: float


def wilson(successes: int, trials: int, confidence: float = CONFIDENCE) -> Interval:
    """Score interval of a rate (Wilson 1927, "Probable inference").

    Raises:
        ValueError: No trials, or more successes than trials.
    """
    return _rate(successes, trials, confidence, "wilson")


def clopper_pearson(successes: int, trials: int, confidence: float = CONFIDENCE) -> Interval:
    """Return the interval of a rate that never covers less than it says (Clopper and Pearson 1934).

    Raises:
        ValueError: No trials, or more successes than trials.
    """
    return _rate(successes, trials, confidence, "exact")


def _rate(successes: int, trials: int, confidence: float, method: str) -> Interval:
    if not 0 <= successes <= trials or trials == 0:
        raise ValueError(f"got {successes} successes in {trials} trials, expected 0 to all of some")
    bounds = stats.binomtest(successes, trials).proportion_ci(confidence, method=method)
    return Interval(successes / trials, float(bounds.low), float(bounds.high))


def quantile_interval(
    values: ArrayLike, share: float = 0.5, confidence: float = CONFIDENCE
) -> Interval:
    """Return a quantile with a distribution-free interval between two values of the sample.

    Order statistics (Conover 1999, "Practical Nonparametric Statistics", section 3.2): that more
    than k of n fall below the quantile is binomial. Values may be infinite, as of what was never
    reached; with too few of them an end of the interval is infinite itself.

    Args:
        values: (n,) at least one.
        share: Probability of the quantile, more than 0 and less than 1.
        confidence: Coverage, at least.

    Raises:
        ValueError: No values.
    """
    ordered = np.sort(np.asarray(values, np.float64))
    count = len(ordered)
    if count == 0:
        raise ValueError("got no values, expected at least one")
    tail = (1.0 - confidence) / 2.0
    ranks = np.arange(count + 1)
    below = stats.binom.cdf(ranks, count, share)
    low = int(np.searchsorted(below, tail, side="right")) - 1  # P(at most low of n below) <= tail
    high = int(np.searchsorted(below, 1.0 - tail, side="left"))
    return Interval(
        float(np.quantile(ordered, share, method="inverted_cdf")),
        float(ordered[low]) if low >= 0 else -np.inf,
        float(ordered[high]) if high < count else np.inf,
    )


def mcnemar(only_first: int, only_second: int) -> float:
    """Return the exact two-sided p that discordant pairs fall either way alike (McNemar 1947).

    Args:
        only_first: Pairs in which the first alone succeeded.
        only_second: Pairs in which the second alone did.
    """
    discordant = only_first + only_second
    if discordant == 0:
        return 1.0
    return float(stats.binomtest(only_first, discordant, 0.5).pvalue)


def holm(p_values: Sequence[float]) -> list[float]:
    """Return P-values adjusted for their number, step down (Holm 1979); in the order given."""
    count = len(p_values)
    adjusted = [0.0] * count
    highest = 0.0
    for rank, index in enumerate(sorted(range(count), key=lambda k: p_values[k])):
        highest = max(highest, min(1.0, (count - rank) * p_values[index]))
        adjusted[index] = highest
    return adjusted


def paired_rate_difference(
    first: ArrayLike, second: ArrayLike, confidence: float = CONFIDENCE
) -> Interval:
    """Return the rate of the second less that of the first, for pairs independent of each other.

    Newcombe (1998), "Improved confidence intervals for the difference between binomial proportions
    based on paired data", method 10: the Wilson limits of both rates, combined with the correlation
    of the pairs. Unlike a bootstrap it knows that no flip in n pairs does not mean none ever.

    Args:
        first: (n,) successes, 0 or 1.
        second: (n,) of the same episodes, the other way.
        confidence: Coverage.

    Raises:
        ValueError: No pairs, or not as many of one as of the other.
    """
    a, b = _pairs(first, second)
    count = len(a)
    p, q = wilson(int(a.sum()), count, confidence), wilson(int(b.sum()), count, confidence)
    phi = _phi(a, b)
    down, up = q.estimate - q.low, q.high - q.estimate
    left, right = p.estimate - p.low, p.high - p.estimate
    difference = q.estimate - p.estimate
    below = np.sqrt(max(down**2 - 2 * phi * down * right + right**2, 0.0))
    above = np.sqrt(max(up**2 - 2 * phi * up * left + left**2, 0.0))
    return Interval(difference, float(difference - below), float(difference + above))


def _phi(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Return the correlation of two binary samples, if positive with Newcombe's correction."""
    both, only_a = float((a * b).sum()), float((a * (1 - b)).sum())
    only_b, neither = float(((1 - a) * b).sum()), float(((1 - a) * (1 - b)).sum())
    margins = (both + only_a) * (only_b + neither) * (both + only_b) * (only_a + neither)
    if margins == 0.0:
        return 0.0
    numerator = both * neither - only_a * only_b
    if numerator > 0.0:
        numerator = max(numerator - len(a) / 2, 0.0)
    return float(numerator / np.sqrt(margins))


def restricted_mean(times: ArrayLike, reached: ArrayLike, limit: float) -> float:
    """Return the mean time to goal up to a limit, s; an episode that never arrives counts it whole.

    Royston and Parmar (2013), "Restricted mean survival time". A mean over those who arrived would
    fall when the slow ones begin to fail.

    Args:
        times: (n,) s.
        reached: (n,) whether the goal was reached.
        limit: s.
    """
    capped = np.where(np.asarray(reached, bool), np.minimum(times, limit), limit)
    return float(capped.mean())


def _pairs(first: ArrayLike, second: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    a, b = np.asarray(first, np.float64), np.asarray(second, np.float64)
    if a.shape != b.shape or a.ndim != 1 or len(a) == 0:
        raise ValueError(f"got {a.shape} and {b.shape}, expected as many of each, at least one")
    return a, b
