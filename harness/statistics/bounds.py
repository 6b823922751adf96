"""Ends of intervals of a mean, for many samples of the same size at once.

Two families: from the ends of the support alone, whatever the distribution; and from the spread of
the sample, by Student's t and the bootstrap-t.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

Array = NDArray[np.float64]

DRAWS = 10_000
"""Weights or resamples of a sample at least; the ends then move by about 1 % of the width."""

MOST_DRAWN = 20_000_000
"""Weights or resampled values held for samples of one size."""

FEWEST_DRAWS = 2_000
"""Least number of draws, even for samples of thousands of worlds."""

SKEWNESS_SHARE = 0.4
"""Share of a tail at which the bootstrap-t takes its quantile. At the full tail the interval of
lognormal values covers 0.90 in place of 0.95 at 5 values; at this share 0.94."""

ALIKE = 1e-6
"""A resample that varies by less than this share of the sample's deviation holds one value."""

CHUNK = 2_000_000
"""Weighted means held at a time."""


@dataclass(frozen=True)
class Ends:
    """Both ends of the intervals of n samples, (n,) each."""

    low: Array
    high: Array


def bounded(means: Array, low: Array, high: Array, tail: float) -> Ends:
    """Return the interval of a bounded figure's mean: of rates Clopper and Pearson's (1934).

    Gaffke (2005), "Three test statistics for a nonparametric one-sided hypothesis on the mean of a
    nonnegative variable": the sample with one value more, at the end of the support, weighted by a
    flat Dirichlet distribution. Learned-Miller and Thomas (2019), "A new confidence interval for
    the mean of a bounded random variable", find it to cover in every case that they tried.

    Args:
        means: (n, k).
        low: (n,) ends of the support; infinite where it has none.
        high: (n,)
        tail: Share of the samples that an end may miss.
    """
    ends = Ends(low.copy(), high.copy())
    extreme = np.isfinite(low) & np.isfinite(high)
    extreme &= ((means == low[:, None]) | (means == high[:, None])).all(axis=1)
    if extreme.any():
        rates = _clopper_pearson(means[extreme] == high[extreme, None], tail)
        width = high[extreme] - low[extreme]
        ends.low[extreme] = low[extreme] + width * rates.low
        ends.high[extreme] = low[extreme] + width * rates.high
    for side, quantile in ((ends.low, tail), (ends.high, 1.0 - tail)):
        drawn = ~extreme & np.isfinite(side)
        if drawn.any():
            side[drawn] = _weighted_quantile(means[drawn], side[drawn], quantile, tail)
    return ends


def _clopper_pearson(successes: NDArray[np.bool_], tail: float) -> Ends:
    count, trials = successes.sum(axis=1), successes.shape[1]
    low = stats.beta.ppf(tail, count, trials - count + 1)
    high = stats.beta.ppf(1.0 - tail, count + 1, trials - count)
    return Ends(np.where(count == 0, 0.0, low), np.where(count == trials, 1.0, high))


def _weighted_quantile(means: Array, end: Array, quantile: float, tail: float) -> Array:
    """Return the quantile (n,) of the flat Dirichlet mean of each sample and a support's end."""
    sample = np.column_stack([means, end])
    weights = _dirichlet(sample.shape[1], _draws(sample.shape[1], tail))
    step = max(1, CHUNK // weights.shape[1])
    parts = [
        np.quantile(sample[at : at + step] @ weights, quantile, axis=1)
        for at in range(0, len(sample), step)
    ]
    return np.concatenate(parts)


def _draws(size: int, tail: float) -> int:
    """Return so many draws that ten lie beyond the quantile, as far as they can be held."""
    most = max(FEWEST_DRAWS, MOST_DRAWN // size)
    return min(max(DRAWS, math.ceil(10.0 / tail)), most)


@functools.lru_cache(maxsize=2)
def _dirichlet(size: int, draws: int) -> Array:
    """Return weights that sum to one, (size, draws); the same ones for every sample."""
    exponentials = np.random.default_rng([size, draws]).standard_exponential((size, draws))
    weights: Array = exponentials / exponentials.sum(axis=0)
    return weights


def studentized(means: Array, tail: float) -> Ends:
    """Return the wider of Student's t and of the bootstrap-t, which follows a sample's skewness.

    Efron and Tibshirani (1993), "An Introduction to the Bootstrap", section 12.5. A resample of
    one value only stands for an infinite t.

    Args:
        means: (n, k), k at least 2, of which not all are equal.
        tail: Share of the samples that an end may miss.
    """
    count = means.shape[1]
    if len(means) == 0:
        return Ends(np.zeros(0), np.zeros(0))
    middle = means.mean(axis=1)
    error = means.std(axis=1, ddof=1) / math.sqrt(count)
    normal = stats.t.ppf(1.0 - tail, count - 1)
    low, high = _bootstrap_t(means, SKEWNESS_SHARE * tail)
    return Ends(
        middle - np.maximum(high, normal) * error, middle - np.minimum(low, -normal) * error
    )


def _bootstrap_t(means: Array, tail: float) -> tuple[Array, Array]:
    """Return quantiles of the studentized mean in resamples of each sample, (n,) each."""
    count = means.shape[1]
    times = _resamples(count, _draws(count, tail))  # (k, draws)
    centred = means - means.mean(axis=1, keepdims=True)
    centred /= means.std(axis=1, keepdims=True)
    step = max(1, CHUNK // times.shape[1])
    parts = []
    for at in range(0, len(centred), step):
        sample = centred[at : at + step]
        middle = sample @ times / count
        variance = np.maximum(np.square(sample) @ times / count - np.square(middle), 0.0)
        error = np.sqrt(variance / (count - 1))
        t = np.where(
            error > ALIKE, middle / np.maximum(error, ALIKE), np.copysign(math.inf, middle)
        )
        parts.append(np.quantile(t, [tail, 1.0 - tail], axis=1, method="inverted_cdf"))
    low, high = np.concatenate(parts, axis=1)
    return low, high


@functools.lru_cache(maxsize=2)
def _resamples(size: int, draws: int) -> Array:
    """Return the count of each of `size` values in each resample, (size, draws)."""
    generator = np.random.default_rng([size, draws, 1])
    return generator.multinomial(size, np.full(size, 1.0 / size), draws).T.astype(np.float64)
