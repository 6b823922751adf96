"""Intervals that hold at every look: worlds may be added until they decide.

Waudby-Smith and Ramdas (2024), "Estimating means of bounded random variables by betting": if no
world's expected value is above m, whoever bets on them at fair odds has a capital that is a
nonnegative supermartingale, and it ever reaches 1/a with probability a at most (Ville 1939). So
the means at which it did are refuted, however often one looked (Howard et al. 2021, "Time-uniform,
nonparametric, nonasymptotic confidence sequences"). The capital here is that of a mixture of fixed
bets, which needs no estimate of the spread.

The order of the worlds must not depend on their values: it is that in which they were planned.
"""

from __future__ import annotations

import math

import numpy as np

from wayproof.harness.statistics.bounds import Array
from wayproof.harness.statistics.exact import Interval

FRACTIONS = np.array([1.0, 0.8, 0.55, 0.3, 0.15, 0.06])
"""Share of the capital that each bet of the mixture puts on every world."""

WEIGHTS = np.array([5.0, 2.0, 2.0, 2.0, 2.0, 2.0]) / 15.0
"""Share of the first capital that each bet has. The first bet is of all of it, the best one where
worlds hardly differ: the mixture then needs a quarter more of them than one look."""

HALVINGS = 30
"""Number of halvings that find an end of an interval."""


def evidence(values: Array, mean: float) -> Array:
    """Return the logarithm of the capital of bets that values lie above a mean, after each, (n,).

    Args:
        values: (n,) not below 0, in the order in which they came.
        mean: The mean that is doubted, more than 0.
    """
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        capital = np.cumprod(1.0 + FRACTIONS * (values[:, None] / mean - 1.0), axis=0)
        # A bet of all that lost is worth nothing, whatever it had won: not 0 times infinity.
        logarithm: Array = np.log(np.where(np.isnan(capital), 0.0, capital) @ WEIGHTS)
    return logarithm


def mean_sequence(values: Array, low: float, high: float, confidence: float) -> Interval:
    """Return the mean of bounded values, with an interval that holds at every look.

    Args:
        values: (n,) of the worlds, in the order in which they were planned; at least one.
        low: Lower end of their support.
        high: Upper end.
        confidence: Coverage at all looks together.
    """
    shares = np.clip((values - low) / (high - low), 0.0, 1.0)
    least = math.log(2.0 / (1.0 - confidence))
    below, above = _refuted(shares, least), 1.0 - _refuted(1.0 - shares, least)
    if below > above:  # of two looks that contradict each other, the first counts
        return mean_sequence(values[:-1], low, high, confidence)
    width = high - low
    return Interval(float(values.mean()), low + width * below, low + width * above)


def _refuted(shares: Array, least: float) -> float:
    """Return the greatest mean at which the capital of a bet on more has ever been so large."""
    refuted, kept = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = (refuted + kept) / 2.0
        if evidence(shares, middle).max() >= least:
            refuted = middle
        else:
            kept = middle
    return refuted


def median_sequence(values: Array, confidence: float) -> Interval:
    """Return the median of any values, with an interval that holds at every look.

    A place is below the median if more than half of the worlds are shown to lie above it. Nothing
    is assumed of the values, and a rare jump does not count by its size.

    Args:
        values: (n,) of the worlds, in the order in which they were planned; at least one.
        confidence: Coverage at all looks together.
    """
    least = math.log(2.0 / (1.0 - confidence))
    low, high = _below_median(values, least), -_below_median(-values, least)
    if low > high:
        return median_sequence(values[:-1], confidence)
    return Interval(float(np.median(values)), low, high)


def _below_median(values: Array, least: float) -> float:
    """Return the greatest value that is shown not to be above the median; -inf without one."""
    places = np.unique(values)
    begin, end = 0, len(places)  # places before `begin` are shown to be no higher than the median
    while begin < end:
        middle = (begin + end) // 2
        if evidence((values >= places[middle]).astype(np.float64), 0.5).max() >= least:
            begin = middle + 1
        else:
            end = middle
    return float(places[begin - 1]) if begin else -math.inf
