"""Ends of intervals of the mean of a sample.

Two families: from the ends of the support alone, whatever the distribution; and from the spread of
the sample, by Student's t and the bootstrap-t.
"""

from __future__ import annotations

import functools
import math

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from wayproof.harness.statistics.exact import clopper_pearson

Array = NDArray[np.float64]

Ends = tuple[float, float]
"""Lower and upper end; infinite without one."""

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


def bounded(means: Array, low: float, high: float, tail: float) -> Ends:
    """Return the interval of a bounded figure's mean: of rates Clopper and Pearson's (1934).

    Gaffke (2005), "Three test statistics for a nonparametric one-sided hypothesis on the mean of a
    nonnegative variable": the sample with one value more, at the end of the support, weighted by a
    flat Dirichlet distribution. Learned-Miller and Thomas (2019), "A new confidence interval for
    the mean of a bounded random variable", find it to cover in every case that they tried.

    Args:
        means: (k,).
        low: Lower end of the support; infinite where it has none.
        high: Upper end.
        tail: Share of the samples that an end may miss.
    """
    if math.isfinite(high - low) and ((means == low) | (means == high)).all():
        rate = clopper_pearson(int((means == high).sum()), len(means), 1.0 - 2.0 * tail)
        return low + (high - low) * rate.low, low + (high - low) * rate.high
    below, above = (
        _weighted_quantile(means, end, quantile, tail) if math.isfinite(end) else end
        for end, quantile in ((low, tail), (high, 1.0 - tail))
    )
    return below, above


def _weighted_quantile(means: Array, end: float, quantile: float, tail: float) -> float:
    """Return the quantile of the flat Dirichlet mean of a sample and a support's end."""
    sample = np.append(means, end)
    weights = _dirichlet(len(sample), _draws(len(sample), tail))
    return float(np.quantile(sample @ weights, quantile))


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
        means: (k,), k at least 2, not all equal.
        tail: Share of the samples that an end may miss.
    """
    count, middle = len(means), float(means.mean())
    error = float(means.std(ddof=1)) / math.sqrt(count)
    normal = float(stats.t.ppf(1.0 - tail, count - 1))
    low, high = _bootstrap_t(means, SKEWNESS_SHARE * tail)
    return middle - max(high, normal) * error, middle - min(low, -normal) * error


def _bootstrap_t(means: Array, tail: float) -> Ends:
    """Return quantiles of the studentized mean in resamples of a sample."""
    count = len(means)
    times = _resamples(count, _draws(count, tail))  # (k, draws)
    centred = (means - means.mean()) / means.std()
    middle = centred @ times / count
    variance = np.maximum(np.square(centred) @ times / count - np.square(middle), 0.0)
    error = np.sqrt(variance / (count - 1))
    t = np.where(error > ALIKE, middle / np.maximum(error, ALIKE), np.copysign(math.inf, middle))
    low, high = np.quantile(t, [tail, 1.0 - tail], method="inverted_cdf")
    return float(low), float(high)


@functools.lru_cache(maxsize=2)
def _resamples(size: int, draws: int) -> Array:
    """Return the count of each of `size` values in each resample, (size, draws)."""
    generator = np.random.default_rng([size, draws, 1])
    return generator.multinomial(size, np.full(size, 1.0 / size), draws).T.astype(np.float64)
