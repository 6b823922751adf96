"""What a study says: rates with intervals, pairs against their twins, gates."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from harness.metrics import METRICS
from harness.statistics import (
    CONFIDENCE,
    Interval,
    holm,
    mcnemar,
    paired_difference,
    paired_rate_difference,
    restricted_mean,
    wilson,
)
from harness.study.file import Arm, Gate
from harness.study.rows import Row, first_difference, prove, reference_of, share_differing

BOOTSTRAP_SEED = 0
"""Of every interval of a study, so that the same rows give the same report."""

Pairs = list[tuple[Row, Row]]


@dataclass(frozen=True)
class Comparison:
    """An arm against its reference, pair by pair.

    Attributes:
        pairs: Their number.
        drop: Success rate of the reference less that of the arm.
        p_value: McNemar's exact test on success.
        p_adjusted: After Holm, among the severities of one perturbation.
        lost: Seeds that succeed in the reference alone.
        won: Seeds that succeed in the arm alone.
        changed: Pairs in which any decision made the robot do something else.
        first_difference: Median number of the first such decision among those.
        share_differing: Mean share of such decisions.
        streams: Inputs that differ in any pair before the body was asked for another thing.
        proven: Pairs in which no input differs until then but those that a perturbation declares.
        undeclared: Seeds of the pairs in which another one does.
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
    """One arm of the study.

    Attributes:
        arm: Which.
        episodes: Their number, errors among them.
        success: Rate with its Wilson interval.
        outcomes: Count of each.
        causes: Count of each, of failures.
        mean_time: Restricted mean time to goal, s: a failure counts the time limit.
        metrics: Mean of each over the episodes that have it.
        against: The reference, pair by pair; none for a reference.
    """

    arm: Arm
    episodes: int
    success: Interval
    outcomes: dict[str, int]
    causes: dict[str, int]
    mean_time: float
    metrics: dict[str, float | None]
    against: Comparison | None


Verdict = Literal["held", "failed", "open"]


@dataclass(frozen=True)
class GateResult:
    """What one gate says of one arm.

    Attributes:
        gate: As written.
        arm: Which.
        verdict: `held`: the whole interval keeps the bound; `failed`: the whole interval breaks it,
            or does not keep it where the gate asks for proof; `open`: the interval holds the bound.
        interval: Of the gate's statistic, all arms of the gate together at 95 %.
    """

    gate: str
    arm: Arm
    verdict: Verdict
    interval: Interval


@dataclass(frozen=True)
class Sample:
    """The episodes of one arm.

    Attributes:
        arm: Which.
        rows: They.
        pairs: Twin and row, for each seed that has both; none for a reference.
    """

    arm: Arm
    rows: list[Row]
    pairs: Pairs


def samples_of(rows: Sequence[Row], first_variant: str) -> list[Sample]:
    """Every arm of a study in the order of its first row, paired with its reference."""
    by_arm = group(rows)
    samples = []
    for arm, own in by_arm.items():
        reference = reference_of(arm, first_variant)
        pairs = pair(own, by_arm.get(reference, [])) if reference else []
        samples.append(Sample(arm, own, pairs))
    return samples


def samples_between(before: Sequence[Row], after: Sequence[Row]) -> list[Sample]:
    """Every arm of the second study, paired with the same arm of the first."""
    references = group(before)
    return [
        Sample(arm, own, pair(own, references.get(arm, []))) for arm, own in group(after).items()
    ]


def summarise(samples: Sequence[Sample], time_limit: float) -> list[ArmSummary]:
    """Every arm, with p-values corrected for their number."""
    return _adjust([_summary(one.arm, one.rows, one.pairs, time_limit) for one in samples])


def group(rows: Sequence[Row]) -> dict[Arm, list[Row]]:
    """Rows by arm."""
    by_arm: dict[Arm, list[Row]] = {}
    for row in rows:
        by_arm.setdefault(row.arm, []).append(row)
    return by_arm


def pair(rows: Sequence[Row], references: Sequence[Row]) -> Pairs:
    """Reference and row of each seed that both have; a failure and an error are kept."""
    twins = {twin.seed: twin for twin in references}
    return [(twins[row.seed], row) for row in rows if row.seed in twins]


def _summary(arm: Arm, rows: Sequence[Row], pairs: Pairs, time_limit: float) -> ArmSummary:
    successes = sum(row.success for row in rows)
    times = [row.duration for row in rows]
    return ArmSummary(
        arm=arm,
        episodes=len(rows),
        success=wilson(successes, len(rows)),
        outcomes=dict(Counter(row.outcome for row in rows)),
        causes=dict(Counter(row.cause for row in rows if row.cause)),
        mean_time=restricted_mean(times, [row.success for row in rows], time_limit),
        metrics={name: _mean([row.metrics[name] for row in rows]) for name in METRICS},
        against=_compare(pairs) if pairs else None,
    )


def _compare(pairs: Pairs) -> Comparison:
    lost = tuple(row.seed for twin, row in pairs if twin.success and not row.success)
    won = tuple(row.seed for twin, row in pairs if row.success and not twin.success)
    firsts = [first_difference(row, twin) for twin, row in pairs]
    changed = [first for first in firsts if first is not None]
    proofs = [(row.seed, prove(row, twin)) for twin, row in pairs]
    known = [(seed, proof) for seed, proof in proofs if proof is not None]
    p_value = mcnemar(len(lost), len(won))
    return Comparison(
        pairs=len(pairs),
        drop=difference(pairs, "success", -1.0),
        p_value=p_value,
        p_adjusted=p_value,
        lost=lost,
        won=won,
        changed=len(changed),
        first_difference=float(np.median(changed)) if changed else None,
        share_differing=float(np.mean([share_differing(row, twin) for twin, row in pairs])),
        streams=tuple(sorted({name for _, one in known for name in one.pairing.changed})),
        proven=sum(not one.undeclared for _, one in known),
        undeclared=tuple(seed for seed, one in known if one.undeclared),
    )


def difference(
    pairs: Pairs, metric: str, sign: float = 1.0, confidence: float = CONFIDENCE
) -> Interval:
    """Mean of row - twin, times `sign`, over the pairs in which both have the metric.

    Success goes by Newcombe's intervals where no two pairs share a generated world; everything else
    by a bootstrap over worlds, which a seed of a generator and the file of an imported one are.
    """
    both = [(a.metrics[metric], b.metrics[metric], _cluster(b)) for a, b in pairs]
    kept = [(a, b, c) for a, b, c in both if a is not None and b is not None]
    if not kept:
        return Interval(float("nan"), float("nan"), float("nan"))
    first, second, clusters = (list(column) for column in zip(*kept, strict=True))
    if sign < 0:
        first, second = second, first
    if metric == "success" and len(set(clusters)) == len(clusters):
        return paired_rate_difference(first, second, confidence)
    if len(set(clusters)) < 2:
        mean = float(np.mean(np.subtract(second, first)))
        return Interval(mean, -np.inf, np.inf)
    return paired_difference(first, second, clusters, BOOTSTRAP_SEED, confidence)


def _cluster(row: Row) -> tuple[str, int]:
    """The world that an episode ran in."""
    imported = "/" in row.arm.world or "." in row.arm.world
    return (row.arm.world, 0 if imported else row.seed)


def _mean(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None


def _adjust(summaries: list[ArmSummary]) -> list[ArmSummary]:
    """Holm's correction among the arms that answer one question: a perturbation's severities."""
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


def judge(samples: Sequence[Sample], gates: Sequence[Gate]) -> list[GateResult]:
    """Every gate on every arm that it speaks of."""
    results = []
    for gate in gates:
        spoken_of = [one for one in samples if one.pairs or gate.statistic == "mean"]
        confidence = 1.0 - (1.0 - CONFIDENCE) / max(len(spoken_of), 1)  # Bonferroni: all at once
        for one in spoken_of:
            interval = _gated(one.rows, one.pairs, gate, confidence)
            results.append(GateResult(gate.text, one.arm, verdict_of(gate, interval), interval))
    return results


def _gated(rows: Sequence[Row], pairs: Pairs, gate: Gate, confidence: float) -> Interval:
    if gate.statistic == "mean":
        return mean_interval(rows, gate.metric, confidence)
    return difference(pairs, gate.metric, -1.0 if gate.statistic == "drop" else 1.0, confidence)


def mean_interval(rows: Sequence[Row], metric: str, confidence: float) -> Interval:
    """Mean of a metric: Wilson's interval for success, a bootstrap over worlds otherwise."""
    if metric == "success":
        return wilson(sum(row.success for row in rows), len(rows), confidence)
    known = [row for row in rows if row.metrics[metric] is not None]
    values = [float(row.metrics[metric] or 0.0) for row in known]
    if len({_cluster(row) for row in known}) < 2:
        mean = float(np.mean(values)) if values else float("nan")
        return Interval(mean, -np.inf, np.inf)
    clusters = [_cluster(row) for row in known]
    return paired_difference([0.0] * len(values), values, clusters, BOOTSTRAP_SEED, confidence)


def verdict_of(gate: Gate, interval: Interval) -> Verdict:
    """Whether an interval keeps a gate's bound, breaks it, or cannot tell."""
    low, high = interval.low, interval.high
    keeps = high <= gate.bound if gate.at_most else low >= gate.bound
    breaks = low > gate.bound if gate.at_most else high < gate.bound
    if keeps:
        return "held"
    return "failed" if breaks or gate.proven else "open"
