"""What a study says of each arm: rates with intervals, pairs against their twins."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from wayproof.harness.metrics import METRICS
from wayproof.harness.study.file import Arm
from wayproof.harness.study.rows import Row, first_difference, prove, reference_of, share_differing
from wayproof.harness.study.statistics.exact import Interval, holm, mcnemar, restricted_mean
from wayproof.harness.study.statistics.intervals import difference_interval, mean_interval

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
        success: Rate with its exact 95 % interval over worlds.
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


@dataclass(frozen=True)
class Sample:
    """The episodes of one arm.

    Attributes:
        arm: Which.
        rows: They.
        pairs: Twin and row, for each seed that has both.
        compared: Whether it has a reference; the pairs may be missing all the same.
    """

    arm: Arm
    rows: list[Row]
    pairs: Pairs
    compared: bool


def samples_of(rows: Sequence[Row], first_variant: str) -> list[Sample]:
    """Every arm of a study in the order of its first row, paired with its reference."""
    by_arm = group(rows)
    samples = []
    for arm, own in by_arm.items():
        reference = reference_of(arm, first_variant)
        pairs = pair(own, by_arm.get(reference, [])) if reference else []
        samples.append(Sample(arm, own, pairs, reference is not None))
    return samples


def samples_between(before: Sequence[Row], after: Sequence[Row]) -> list[Sample]:
    """Every arm of the second study, paired with the same arm of the first."""
    references = group(before)
    return [
        Sample(arm, own, pair(own, references.get(arm, [])), compared=True)
        for arm, own in group(after).items()
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
    times = [row.duration for row in rows]
    return ArmSummary(
        arm=arm,
        episodes=len(rows),
        success=mean_interval(
            [row.metrics["success"] or 0.0 for row in rows],
            [cluster_of(row) for row in rows],
            METRICS["success"].support,
        ),
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


def difference(pairs: Pairs, metric: str, sign: float = 1.0) -> Interval:
    """Mean of row - twin, times `sign`, over the pairs in which both have the metric."""
    both = [(a.metrics[metric], b.metrics[metric], cluster_of(b)) for a, b in pairs]
    kept = [(a, b, c) for a, b, c in both if a is not None and b is not None]
    first, second, clusters = (list(column) for column in zip(*kept, strict=True))
    if sign < 0:
        first, second = second, first
    return difference_interval(first, second, clusters, METRICS[metric].support)


def cluster_of(row: Row) -> tuple[str, int]:
    """The world of an episode: a seed of a generator, or the file of an imported one."""
    return (row.arm.world, 0 if is_imported(row.arm.world) else row.seed)


def is_imported(world: str) -> bool:
    """Whether a world is a file, the same for every seed."""
    return "/" in world or "." in world


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
