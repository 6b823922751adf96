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

import numpy as np
from numpy.typing import ArrayLike, NDArray

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
    greatest = np.array([np.max(np.asarray(values, np.float64))])
    ends = interval_ends(means[None, :], support, confidence, greatest)
    return Interval(float(means.mean()), float(ends.low[0]), float(ends.high[0]))


def difference_interval(
    first: ArrayLike,
    second: ArrayLike,
    clusters: Sequence[object],
    support: Support,
    confidence: float = CONFIDENCE,
) -> Interval:
    """Return the mean of second - first over worlds, from pairs, with its interval.

    One pair of a rate in each world goes by Newcombe's interval from `LEAST_CLUSTERS` worlds on,
    and so do counts of which no episode shows more than one, from `LEAST_COUNTED` on.

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
    if len(means) == len(a):
        ends = pair_ends(a[None, :], b[None, :], support, confidence)
    else:
        greatest = np.array([max(a.max(), b.max())])
        ends = interval_ends(means[None, :], support.difference, confidence, greatest)
    return Interval(float(means.mean()), float(ends.low[0]), float(ends.high[0]))


def pair_ends(first: Array, second: Array, support: Support, confidence: float) -> Ends:
    """Return intervals of the mean of second - first, of samples of k clusters with a pair each.

    Args:
        first: (n, k) figures.
        second: (n, k) their partners.
        support: Support of the figure itself.
        confidence: Coverage of each interval by itself.
    """
    greatest = np.maximum(first.max(axis=1), second.max(axis=1))
    ends = interval_ends(second - first, support.difference, confidence, greatest)
    least = {"rate": LEAST_CLUSTERS, "count": LEAST_COUNTED}.get(support.kind, math.inf)
    if first.shape[1] < least:
        return ends
    known: dict[tuple[int, ...], Interval] = {}
    for k in np.flatnonzero(greatest <= 1.0):
        table = tuple(np.bincount((2 * first[k] + second[k]).astype(int), minlength=4).tolist())
        if table not in known:
            known[table] = paired_rate_difference(first[k], second[k], confidence)
        ends.low[k], ends.high[k] = known[table].low, known[table].high
    return ends


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


def interval_ends(
    means: Array, support: Support, confidence: float, greatest: Array | None = None
) -> Ends:
    """Return intervals of many samples at once, each of the same number of clusters.

    Args:
        means: (n, k) of the clusters of each sample.
        support: Support of each value.
        confidence: Coverage of each interval by itself.
        greatest: (n,) largest count in any episode of a sample; by default the largest value.
    """
    tail = (1.0 - confidence) / 2.0
    if support.kind == "count":
        return _count(means, support, tail, greatest)
    if support.kind == "measure":
        return _measure(means, support, tail)
    return bounded(means, *_ends_of(means, support), tail)


def _count(means: Array, support: Support, tail: float, greatest: Array | None) -> Ends:
    """Return intervals of counts from their assumed ends, and from their spread if there is any."""
    if greatest is None:
        greatest = np.abs(means).max(axis=1)
    largest = np.where(greatest > 1.0, 2.0 * greatest, 1.0)
    signed = math.isinf(support.low)
    ends = bounded(means, -largest if signed else np.zeros(len(means)), largest, tail)
    several = _distinct(means) >= LEAST_EVENTS
    spread = studentized(means[several], tail)
    ends.high[several] = np.maximum(ends.high[several], spread.high)
    if signed:
        ends.low[several] = np.minimum(ends.low[several], spread.low)
    if means.shape[1] < LEAST_COUNTED:
        ends.high[:] = math.inf
        ends.low[:] = -math.inf if signed else ends.low
    return ends


def _measure(means: Array, support: Support, tail: float) -> Ends:
    """Return Student's interval, widened for skewness; the support's if values hardly differ."""
    low, high = _ends_of(means, support)
    few = _distinct(means) < LEAST_CLUSTERS
    ends = Ends(low.copy(), high.copy())
    if few.any():
        outer = bounded(means[few], low[few], high[few], tail)
        ends.low[few], ends.high[few] = outer.low, outer.high
    if not few.all():
        spread = studentized(means[~few], tail)
        ends.low[~few] = np.maximum(spread.low, low[~few])
        ends.high[~few] = np.minimum(spread.high, high[~few])
    return ends


def _ends_of(means: Array, support: Support) -> tuple[Array, Array]:
    """Return the ends (n,) of the support, moved out to a sample that rounding took beyond."""
    low = np.minimum(support.low, means.min(axis=1))
    return low, np.maximum(support.high, means.max(axis=1))


def _distinct(means: Array) -> NDArray[np.int64]:
    """Return clusters of each sample that differ from its most frequent value, and one: (n,)."""
    ordered = np.sort(means, axis=1)
    same = np.diff(ordered, axis=1) <= ROUNDING * np.abs(ordered).max(axis=1, keepdims=True)
    run = longest = np.ones(len(means), np.int64)
    for equal in same.T:
        run = np.where(equal, run + 1, 1)
        longest = np.maximum(longest, run)
    distinct: NDArray[np.int64] = means.shape[1] - longest + 1
    return distinct
