"""`wayproof bench coverage`: coverage of intervals, false alarms and power of gates, by simulation.

Every statistic of a gate is the mean of a metric, or the mean of a difference of pairs; the
coverage of its interval depends only on the kind of the metric. Samples are drawn from known
distributions, so that the true mean is known, and are judged by the code that judges studies.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable
from typing import Literal, get_args

import numpy as np

from tests.tools.statistics.looks import bench_looks
from tests.tools.statistics.verdicts import bench_alarms, bench_power
from wayproof.harness.bench.table import Progress
from wayproof.harness.bench.table import Row as Document
from wayproof.harness.statistics.bounds import Array
from wayproof.harness.statistics.intervals import difference_interval, mean_interval
from wayproof.harness.statistics.support import COUNT, MEASURE, RATE, SHARE, TIME, Support

CLUSTERS = (2, 3, 5, 10, 25, 50)

EPISODES = (1, 5)
"""Numbers of episodes of each cluster."""

TIME_LIMIT = 60.0
"""Time limit of an episode, s."""

Data = Literal["normal", "skewed", "rare", "alike"]
"""Distribution: normal (of rates and counts, a plain one); skewed: lognormal worlds; rare: 3 % of
the episodes have an event, all others are alike; alike: all episodes are alike."""

SUPPORTS: dict[str, Support] = {
    "rate": RATE,
    "share": SHARE,
    "count": COUNT,
    "measure": MEASURE,
    "time": TIME.within(TIME_LIMIT),
}

STATISTICS = tuple(f"{kind} {of}" for kind in SUPPORTS for of in ("mean", "difference"))
"""Names of the statistics; `drop` and `rise` are the same difference with either sign."""

SAMPLE = 400_000
"""Number of clusters of the sample for a true mean."""


def _intervals(repeats: int, seed: int, progress: Progress) -> list[Document]:
    """Return a row for each statistic, data and cluster size: `coverage width` by clusters."""
    cases = list(itertools.product(STATISTICS, get_args(Data), EPISODES))
    cells: dict[tuple[str, Data, int], list[Document]] = {case: [] for case in cases}
    for clusters in CLUSTERS:  # outermost: what is drawn for samples of one size is drawn once
        for statistic, data, episodes in cases:
            progress(f"{clusters} clusters: {statistic}, {data}, {episodes} episodes of each")
            row = coverage_of(statistic, data, clusters, episodes, samples=repeats, seed=seed)
            cells[statistic, data, episodes].append(row)
    return [
        {
            "statistic": statistic,
            "data": data,
            "episodes": episodes,
            **{f"k={one['clusters']}": _cell(one) for one in some},
            "least": min(one["coverage"] for one in some),
        }
        for (statistic, data, episodes), some in cells.items()
    ]


def _cell(row: Document) -> str:
    """Return coverage and median width, or `open` where the median interval is unbounded."""
    if row["width"] is None:
        return f"{row['coverage']:.3f} open"
    return f"{row['coverage']:.3f} {row['width']:.2g}"


def coverage_of(
    statistic: str, data: Data, clusters: int, episodes: int, samples: int, seed: int
) -> Document:
    """Return how often the 95 % interval of a statistic contains the true mean."""
    kind, of = statistic.split()
    generator = np.random.default_rng([seed, clusters, episodes])
    first, second = DRAWS[kind](generator, data, (samples, clusters, episodes))
    before, after = _true_means(kind, data)
    support, worlds = SUPPORTS[kind], np.repeat(np.arange(clusters), episodes).tolist()
    if of == "mean":
        intervals = [mean_interval(one.ravel(), worlds, support) for one in second]
        true = after
    else:
        intervals = [
            difference_interval(one.ravel(), other.ravel(), worlds, support)
            for one, other in zip(first, second, strict=True)
        ]
        true = after - before
    low = np.array([one.low for one in intervals])
    high = np.array([one.high for one in intervals])
    slack = 1e-9 * max(1.0, abs(true))
    width = high - low
    return {
        "clusters": clusters,
        "coverage": float(np.mean((low <= true + slack) & (high >= true - slack))),
        "zero_width": float(np.mean(width <= slack)),
        "unbounded": float(np.mean(np.isinf(width))),
        "width": None if np.isinf(np.median(width)) else float(np.median(width)),
    }


@functools.cache
def _true_means(kind: str, data: Data) -> tuple[float, float]:
    first, second = DRAWS[kind](np.random.default_rng(0), data, (1, SAMPLE, 1))
    return float(first.mean()), float(second.mean())


Shape = tuple[int, int, int]
"""Samples, clusters, episodes."""

Pair = tuple[Array, Array]


def _rare(generator: np.random.Generator, shape: Shape) -> Array:
    """Draw 1 for 3 % of the episodes, all of them in half of the worlds."""
    prone = generator.random((*shape[:2], 1)) < 0.5
    return (generator.random(shape) < 0.06 * prone).astype(np.float64)


def _worlds(generator: np.random.Generator, shape: Shape) -> Array:
    """Draw lognormal numbers, one for each world."""
    return generator.lognormal(0.0, 1.0, (*shape[:2], 1))


def _rates(generator: np.random.Generator, data: Data, shape: Shape) -> Pair:
    """Draw successes; skewed: by worlds that are nearly always lost or hardly ever."""
    if data == "alike":
        return np.ones(shape), np.ones(shape)
    if data == "rare":
        return np.ones(shape), 1.0 - _rare(generator, shape)
    ease = generator.normal(0.0, 1.0, (*shape[:2], 1)) if data == "normal" else 0.0
    lost = np.minimum(0.1 * _worlds(generator, shape), 1.0) if data == "skewed" else 0.0
    luck = generator.normal(0.0, 1.0, (2, *shape))
    easy = ease + luck > np.array([-1.5, -1.0])[:, None, None, None]
    kept = generator.random(shape) >= lost
    return easy[0].astype(np.float64), (easy[1] & kept).astype(np.float64)


def _shares(generator: np.random.Generator, data: Data, shape: Shape) -> Pair:
    """Return lengths over lengths, 0 where the goal was missed."""
    best = np.full(shape, 0.9)
    if data == "alike":
        return best, best
    if data == "rare":
        return best, best * (1.0 - _rare(generator, shape))
    first, second = generator.beta(14.0, 6.0, (2, *shape))
    if data == "skewed":
        second = second / (1.0 + 0.3 * _worlds(generator, shape))
    return first, second


def _counts(generator: np.random.Generator, data: Data, shape: Shape) -> Pair:
    """Draw events; rare and skewed ones in the second of the pair alone."""
    nothing = np.zeros(shape)
    if data == "alike":
        return nothing, nothing
    if data == "rare":
        return nothing, _rare(generator, shape)
    if data == "skewed":
        return nothing, generator.poisson(_worlds(generator, shape), shape).astype(np.float64)
    first, second = generator.poisson([[[[4.0]]], [[[5.0]]]], (2, *shape)).astype(np.float64)
    return first, second


def _measures(generator: np.random.Generator, data: Data, shape: Shape) -> Pair:
    """Return numbers around 6 and more; rare: a jump by 10 and more in the second."""
    usual = np.full(shape, 6.0)
    if data == "alike":
        return usual, usual
    if data == "rare":
        jump = 10.0 * generator.lognormal(0.0, 0.5, shape)
        return usual, usual + _rare(generator, shape) * jump
    if data == "skewed":
        return usual, usual + _worlds(generator, shape) * generator.lognormal(0.0, 0.3, shape)
    world = generator.normal(0.0, 1.0, (*shape[:2], 1))
    luck = generator.normal(0.0, 1.0, (2, *shape))
    change = generator.normal(0.5, 0.5, (*shape[:2], 1))
    return usual + world + luck[0], usual + world + luck[1] + change


DRAWS: dict[str, Callable[[np.random.Generator, Data, Shape], Pair]] = {
    "rate": _rates,
    "share": _shares,
    "count": _counts,
    "measure": _measures,
    "time": lambda generator, data, shape: _within_limit(*_measures(generator, data, shape)),
}
"""Kind -> episodes and their partners, of three axes each."""


def _within_limit(first: Array, second: Array) -> Pair:
    return np.clip(first, 0.0, TIME_LIMIT), np.clip(second, 0.0, TIME_LIMIT)


PARTS: dict[str, Callable[[int, int, Progress], list[Document]]] = {
    "intervals": _intervals,
    "alarms": lambda repeats, seed, progress: bench_alarms(repeats, seed, CLUSTERS, progress),
    "looks": bench_looks,
    "power": lambda repeats, seed, progress: bench_power(repeats, seed, CLUSTERS, progress),
}
