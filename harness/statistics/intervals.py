"""Confidence intervals of the mean of a figure over worlds, by the support of that figure.

Worlds are the independent units: the episodes of one world are averaged first, and every world
counts once. What an interval assumes follows from the kind of the figure:

* A rate or a share is bounded: nothing is assumed about its distribution.
* A count has no upper end. Where no episode shows more than one event, none is taken to hold more;
  otherwise twice the largest count seen is taken for the end.
* A measure goes by Student's t, widened for skewness. A jump that no episode of the sample shows is
  not covered: a rate has to be gated for that.

Where there are too few worlds for the assumption, that side of the interval is unbounded.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from wayproof.harness.statistics.bounds import Array, Ends, bounded, studentized
from wayproof.harness.statistics.exact import CONFIDENCE, Interval, paired_rate_difference
from wayproof.harness.statistics.support import Support

LEAST_CLUSTERS = 5
"""Fewer worlds, or fewer of them with distinct values, show no spread of a measure."""

LEAST_COUNTED = 10
"""Fewer worlds show no end of a count."""

ROUNDING = 1e-9
"""Means that differ by less, relative to the largest, are one value."""

LEAST_EVENTS = 8
"""Distinct counts from which their spread is looked at, beside their ends."""


def mean_interval(
    values: ArrayLike,
    clusters: Sequence[object],
    support: Support,
    confidence: float = CONFIDENCE,
) -> Interval:
    """Return the mean of a figure over worlds with its interval.

    Args:
        values: (n,) of the episodes, at least one.
        clusters: (n,) the world of each.
        support: Support of the figure.
        confidence: Coverage.

    Raises:
        ValueError: No values, or not one cluster for each.
    """
    means = cluster_means(values, clusters)
    return _interval(means, support, confidence, float(np.max(np.asarray(values, np.float64))))


def difference_interval(
    first: ArrayLike,
    second: ArrayLike,
    clusters: Sequence[object],
    support: Support,
    confidence: float = CONFIDENCE,
) -> Interval:
    """Return the mean of second - first over worlds, from pairs, with its interval.

    One pair of a rate in each world goes by Newcombe's interval from `LEAST_CLUSTERS` worlds on,
    and so do counts where no episode shows more than one, from `LEAST_COUNTED` on.

    Args:
        first: (n,) of the pairs, at least one.
        second: (n,) of the same.
        clusters: (n,) the world of each pair.
        support: Support of the figure itself.
        confidence: Coverage.

    Raises:
        ValueError: No pairs, or not as many of each.
    """
    a, b = np.asarray(first, np.float64), np.asarray(second, np.float64)
    if a.shape != b.shape:
        raise ValueError(f"got {a.shape} and {b.shape}, expected as many of each")
    means = cluster_means(b - a, clusters)
    greatest = float(max(a.max(), b.max()))
    least = {"rate": LEAST_CLUSTERS, "count": LEAST_COUNTED}.get(support.kind, math.inf)
    if len(means) == len(a) >= least and greatest <= 1.0:
        pairs = paired_rate_difference(a, b, confidence)
        return replace(pairs, estimate=float(means.mean()))
    return _interval(means, support.difference, confidence, greatest)


def cluster_means(values: ArrayLike, clusters: Sequence[object]) -> Array:
    """Return the mean of each cluster, (k,), in the order of their first values.

    Raises:
        ValueError: No values, or not one cluster for each.
    """
    known = np.asarray(values, np.float64)
    if len(known) == 0 or len(known) != len(clusters):
        raise ValueError(f"got {len(clusters)} clusters for {len(known)} values")
    numbers = {name: k for k, name in enumerate(dict.fromkeys(clusters))}
    member = np.array([numbers[name] for name in clusters])
    means: Array = np.bincount(member, weights=known) / np.bincount(member)
    return means


def _interval(means: Array, support: Support, confidence: float, greatest: float) -> Interval:
    """Return the interval of the mean of clusters.

    Args:
        means: (k,) of the clusters.
        support: Support of each.
        confidence: Coverage.
        greatest: Largest value in any episode.
    """
    tail = (1.0 - confidence) / 2.0
    if support.kind == "count":
        low, high = _count(means, support, tail, greatest)
    elif support.kind == "measure":
        low, high = _measure(means, support, tail, greatest)
    else:
        low, high = bounded(means, *_ends_of(means, support), tail)
    return Interval(float(means.mean()), float(low), float(high))


def _count(means: Array, support: Support, tail: float, greatest: float) -> Ends:
    """Return the interval of a count from its assumed ends, and from its spread if there is any."""
    largest = 2.0 * greatest if greatest > 1.0 else 1.0
    signed = math.isinf(support.low)
    low, high = bounded(means, -largest if signed else 0.0, largest, tail)
    if _distinct(means) >= LEAST_EVENTS:
        spread = studentized(means, tail)
        low, high = min(low, spread[0]) if signed else low, max(high, spread[1])
    if len(means) < LEAST_COUNTED:
        return -math.inf if signed else low, math.inf
    return low, high


def _measure(means: Array, support: Support, tail: float, greatest: float) -> Ends:
    """Return Student's interval, widened for skewness; the support's if values hardly differ.

    Where an episode has the greatest value that there is, as a time has that was cut off, the wider
    of both: so few values at the end say little of how many there are.
    """
    low, high = _ends_of(means, support)
    if _distinct(means) < LEAST_CLUSTERS:
        return bounded(means, low, high, tail)
    ends = studentized(means, tail)
    if greatest >= support.high:
        whole = bounded(means, low, high, tail)
        ends = min(ends[0], whole[0]), max(ends[1], whole[1])
    return max(ends[0], low), min(ends[1], high)


def _ends_of(means: Array, support: Support) -> Ends:
    """Return the ends of the support, moved out to a sample that rounding took beyond."""
    return min(support.low, float(means.min())), max(support.high, float(means.max()))


def _distinct(means: Array) -> int:
    """Return the number of clusters that differ from the most frequent value, and one."""
    ordered = np.sort(means)
    new = np.diff(ordered) > ROUNDING * np.abs(ordered).max()
    runs = np.bincount(np.concatenate([[0], np.cumsum(new)]))
    return int(len(means) - runs.max() + 1)
