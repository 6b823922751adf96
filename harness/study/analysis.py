"""Summary of each arm of a study: rates with intervals, and pairs of twins."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.config import HASH_SEPARATOR
from wayproof.harness.metrics import METRICS
from wayproof.harness.statistics.exact import CONFIDENCE, Interval, holm, mcnemar, restricted_mean
from wayproof.harness.statistics.intervals import (
    cluster_means,
    difference_interval,
    mean_interval,
)
from wayproof.harness.statistics.support import TIME, Support
from wayproof.harness.study.plan import Arm
from wayproof.harness.study.rows import Row, first_difference, prove, share_differing

Pairs = list[tuple[Row, Row]]

Value = Callable[[Row], float | None]
"""Function that returns the figure of an episode; None of one that has none."""

NOTHING_RAN = Interval(0.0, 0.0, 1.0)
"""Success rate of an arm without an episode."""


@dataclass(frozen=True)
class Comparison:
    """Comparison of an arm with its reference, pair by pair.

    Attributes:
        pairs: Number of pairs.
        drop: Success rate of the reference minus that of the arm.
        p_value: McNemar's exact test on success.
        p_adjusted: P-value after Holm's correction among the severities of one perturbation.
        lost: Seeds that succeed only in the reference.
        won: Seeds that succeed only in the arm.
        changed: Number of pairs with a decision of another action or path.
        first_difference: Median number of the first such decision in these pairs.
        share_differing: Mean share of such decisions.
        streams: Inputs that differ in any pair before its first differing action.
        proven: Number of pairs whose inputs differ until then only as a perturbation declares.
        undeclared: Seeds of the pairs in which another input differs.
    """

    pairs: int
    drop: Interval
    p_value: float
    p_adjusted: float
    lost: tuple[int, ...]
    won: tuple[int, ...]
    changed: int
    first_difference: float | None
    share_differing: float
    streams: tuple[str, ...]
    proven: int
    undeclared: tuple[int, ...]


@dataclass(frozen=True)
class ArmSummary:
    """Summary of one arm.

    Attributes:
        arm: The arm.
        episodes: Number of episodes, with those that failed to run.
        success: Success rate of those that ran, with its exact 95 % interval over worlds.
        outcomes: Outcome -> number of episodes.
        causes: Cause of failure -> number of episodes.
        mean_time: Restricted mean time to the goal, s; a failure counts as the time limit.
        metrics: Metric -> mean over the episodes that have it.
        against: Comparison with the reference; None for a reference.
    """

    arm: Arm
    episodes: int
    success: Interval
    outcomes: dict[str, int]
    causes: dict[str, int]
    mean_time: float
    metrics: dict[str, float | None]
    against: Comparison | None


@dataclass(frozen=True)
class Sample:
    """Episodes of one arm.

    Attributes:
        arm: The arm.
        rows: Its episodes.
        pairs: (twin, row) of each seed that has both.
        compared: Whether the arm has a reference, even if there are no pairs.
    """

    arm: Arm
    rows: list[Row]
    pairs: Pairs
    compared: bool


def samples_of(rows: Sequence[Row]) -> list[Sample]:
    """Return the samples of a study in the order of their first rows, paired with references."""
    by_arm = group(rows)
    samples = []
    for arm, own in by_arm.items():
        reference = own[0].reference
        pairs = pair(own, by_arm.get(reference, [])) if reference else []
        samples.append(Sample(arm, own, pairs, reference is not None))
    return samples


def samples_between(before: Sequence[Row], after: Sequence[Row]) -> list[Sample]:
    """Return the samples of the second study, paired with the same arms of the first."""
    references = group(before)
    return [
        Sample(arm, own, pair(own, references.get(arm, [])), compared=True)
        for arm, own in group(after).items()
    ]


def summarise(samples: Sequence[Sample], time_limit: float) -> list[ArmSummary]:
    """Summarise every arm, with p-values corrected for their number."""
    return _adjust([_summary(one.arm, one.rows, one.pairs, time_limit) for one in samples])


def group(rows: Sequence[Row]) -> dict[Arm, list[Row]]:
    """Return the rows of each arm."""
    by_arm: dict[Arm, list[Row]] = {}
    for row in rows:
        by_arm.setdefault(row.arm, []).append(row)
    return by_arm


def pair(rows: Sequence[Row], references: Sequence[Row]) -> Pairs:
    """Return (reference, row) of each seed that both have, with failures and errors."""
    twins = {twin.seed: twin for twin in references}
    return [(twins[row.seed], row) for row in rows if row.seed in twins]


def _summary(arm: Arm, rows: Sequence[Row], pairs: Pairs, time_limit: float) -> ArmSummary:
    ran = [row for row in rows if row.ran]
    pairs = [(twin, row) for twin, row in pairs if twin.ran and row.ran]
    times = [row.duration for row in ran]
    return ArmSummary(
        arm=arm,
        episodes=len(rows),
        success=values_of(ran, "success").interval() or NOTHING_RAN,
        outcomes=dict(Counter(row.outcome for row in rows)),
        causes=dict(Counter(row.cause for row in rows if row.cause)),
        mean_time=restricted_mean(times, [row.success for row in ran], time_limit) if ran else 0.0,
        metrics={name: _mean(values_of(rows, name).second) for name in METRICS},
        against=_compare(pairs) if pairs else None,
    )


def _compare(pairs: Pairs) -> Comparison:
    lost = tuple(row.seed for twin, row in pairs if twin.success and not row.success)
    won = tuple(row.seed for twin, row in pairs if row.success and not twin.success)
    firsts = [first_difference(row, twin) for twin, row in pairs]
    shares = [share_differing(row.acts, twin.acts) for twin, row in pairs]
    changed = [first for first in firsts if first is not None]
    proofs = [(row.seed, prove(row, twin)) for twin, row in pairs]
    known = [(seed, proof) for seed, proof in proofs if proof is not None]
    p_value = mcnemar(len(lost), len(won))
    return Comparison(
        pairs=len(pairs),
        drop=drop_of(pairs),
        p_value=p_value,
        p_adjusted=p_value,
        lost=lost,
        won=won,
        changed=len(changed),
        first_difference=float(np.median(changed)) if changed else None,
        share_differing=float(np.mean(shares)),
        streams=tuple(sorted({name for _, one in known for name in one.pairing.changed})),
        proven=sum(not one.undeclared for _, one in known),
        undeclared=tuple(seed for seed, one in known if one.undeclared),
    )


@dataclass(frozen=True)
class Values:
    """Values of a metric whose mean, or whose mean difference, is asked for.

    Attributes:
        second: Value of each episode, or of each pair's second.
        first: Value of each pair's first; None of single episodes.
        clusters: World of each.
        support: Support of the metric.
    """

    second: list[float]
    first: list[float] | None
    clusters: list[tuple[str, int]]
    support: Support

    @property
    def of_worlds(self) -> NDArray[np.float64]:
        """Mean of each world, of second less first for pairs, in the order of episodes, (k,)."""
        own = np.asarray(self.second, np.float64)
        differences = own if self.first is None else own - np.asarray(self.first, np.float64)
        return cluster_means(differences, self.clusters)

    @property
    def ends(self) -> tuple[float, float]:
        """Ends of the support of what is averaged."""
        support = self.support if self.first is None else self.support.difference
        return support.low, support.high

    def interval(self, confidence: float = CONFIDENCE) -> Interval | None:
        """Return the mean over worlds, of second less first for pairs; None without a value."""
        if not self.second:
            return None
        if self.first is None:
            return mean_interval(self.second, self.clusters, self.support, confidence)
        return difference_interval(self.first, self.second, self.clusters, self.support, confidence)


def values_of(rows: Sequence[Row], metric: str, time_limit: float = math.inf) -> Values:
    """Return the values of the episodes that have a metric; a time is at most the limit, s."""
    support = METRICS[metric].support.within(time_limit)
    return values_by(rows, lambda row: row.metrics[metric], support)


def paired_values(pairs: Pairs, metric: str, time_limit: float = math.inf) -> Values:
    """Return the values of the pairs in which both have a metric."""
    support = METRICS[metric].support.within(time_limit)
    return paired_values_by(pairs, lambda row: row.metrics[metric], support)


def values_by(rows: Sequence[Row], value: Value, support: Support) -> Values:
    """Return the values of the episodes that have one."""
    known = [(own, cluster_of(row)) for row in rows if (own := value(row)) is not None]
    return Values([own for own, _ in known], None, [world for _, world in known], support)


def paired_values_by(pairs: Pairs, value: Value, support: Support) -> Values:
    """Return the values of the pairs in which both have one."""
    both = [(value(a), value(b), cluster_of(b)) for a, b in pairs]
    kept = [(a, b, world) for a, b, world in both if a is not None and b is not None]
    return Values(
        second=[b for _, b, _ in kept],
        first=[a for a, _, _ in kept],
        clusters=[world for _, _, world in kept],
        support=support,
    )


def time_to_goal(rows: Sequence[Row], time_limit: float) -> Interval:
    """Return the restricted mean time, s: a failure counts as the limit."""
    times = [row.duration if row.success else time_limit for row in rows]
    return mean_interval(times, [cluster_of(row) for row in rows], TIME.within(time_limit))


def drop_of(pairs: Pairs) -> Interval:
    """Return the success rate of the twins less that of the rows; at least one pair."""
    drop = paired_values([(row, twin) for twin, row in pairs], "success").interval()
    assert drop is not None
    return drop


def cluster_of(row: Row) -> tuple[str, int]:
    """Return the world of an episode: the seed of a generator, or what an imported file holds."""
    return (row.world or row.arm.world, 0 if is_imported(row.arm.world) else row.seed)


def is_imported(world: str) -> bool:
    """Return whether a world is a file or a recording, which is the same for every seed."""
    return "/" in world or "." in world or HASH_SEPARATOR in world


def _mean(values: Sequence[float]) -> float | None:
    return float(np.mean(values)) if values else None


def _adjust(summaries: list[ArmSummary]) -> list[ArmSummary]:
    """Apply Holm's correction among the severities of each perturbation."""
    families: dict[tuple[str, ...], list[int]] = {}
    for k, one in enumerate(summaries):
        if one.against is not None:
            arm = one.arm
            families.setdefault((arm.world, arm.robot, arm.perturbation), []).append(k)
    for members in families.values():
        compared = [_against(summaries[k]) for k in members]
        adjusted = holm([one.p_value for one in compared])
        for k, comparison, p in zip(members, compared, adjusted, strict=True):
            summaries[k] = replace(summaries[k], against=replace(comparison, p_adjusted=p))
    return summaries


def _against(summary: ArmSummary) -> Comparison:
    assert summary.against is not None
    return summary.against
