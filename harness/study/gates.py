"""Gates of a study: bounds on the mean of a metric, each with its interval and its verdict."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from wayproof.harness.config import BUILTIN
from wayproof.harness.metrics import METRICS, OF_STACKS_ON_TRIAL
from wayproof.harness.statistics.exact import CONFIDENCE, Interval
from wayproof.harness.statistics.support import RATE
from wayproof.harness.study.analysis import (
    Sample,
    Values,
    is_imported,
    paired_values_by,
    values_by,
)
from wayproof.harness.study.gate import Figure, Gate
from wayproof.harness.study.plan import Arm, name_of
from wayproof.harness.study.rows import Row

Verdict = Literal["held", "failed", "inconclusive"]


@dataclass(frozen=True)
class GateResult:
    """Result of a gate on one arm, or on all imported worlds together.

    Attributes:
        gate: Text of the gate.
        arm: The arm.
        verdict: `held`: the whole interval keeps the bound; `failed`: the whole interval breaks it;
            `inconclusive`: neither.
        interval: Interval of the statistic; None if no episode has the metric.
        gates: Number of simultaneous 95 % intervals, by Bonferroni's correction.
        worlds: Number of independent worlds.
        worlds_needed: Approximate number of worlds that would decide the gate at the same estimate;
            None if it is decided, or if the estimate is the bound.
        keeps: Whether the estimate keeps the bound: then these worlds would show it held, else
            failed.
        required: Whether the gate is `proven`: it must be held even if inconclusive ones may pass.
        figure: What is bounded.
        sequential: Whether the interval holds at every look.
        episodes: Number of episodes, or of pairs.
    """

    gate: str
    arm: Arm
    verdict: Verdict
    interval: Interval | None
    gates: int
    worlds: int
    worlds_needed: int | None
    required: bool
    keeps: bool = True
    figure: Figure = "mean"
    sequential: bool = False
    episodes: int = 0


def judge(
    samples: Sequence[Sample], gates: Sequence[Gate], time_limit: float = math.inf
) -> list[GateResult]:
    """Judge every gate on every arm it applies to, without the episodes that did not run.

    Args:
        samples: The arms.
        gates: The gates.
        time_limit: Time limit of an episode, s, the greatest value of a time.
    """
    populations = _populations(samples)
    judged = [(gate, one) for gate in gates for one in _arms_of(gate, populations)]
    intervals = sum(gate.figure != "worst" for gate, _ in judged)
    return [_judge(gate, one, max(intervals, 1), time_limit) for gate, one in judged]


def _arms_of(gate: Gate, samples: Sequence[Sample]) -> list[Sample]:
    """Return the arms that a gate is judged on.

    No referee judges the built-in stack, so its arms are left out beside those of stacks on trial.
    Without these they stay, and the gate is inconclusive, as nothing is shown.
    """
    arms = [one for one in samples if one.compared or gate.statistic in ("mean", "every")]
    if gate.metric not in OF_STACKS_ON_TRIAL:
        return arms
    return [one for one in arms if one.arm.stack != BUILTIN] or arms


def _populations(samples: Sequence[Sample]) -> list[Sample]:
    """Return the arms; those that differ only in their imported world are merged into one."""
    pooled: dict[Arm, list[Sample]] = {}
    for one in samples:
        imported = is_imported(one.arm.world)
        pooled.setdefault(replace(one.arm, world="") if imported else one.arm, []).append(one)
    return [_pool(some) for some in pooled.values()]


def _pool(samples: Sequence[Sample]) -> Sample:
    if len(samples) == 1:
        return samples[0]
    rows = [row for one in samples for row in one.rows]
    pairs = [pair for one in samples for pair in one.pairs]
    arm = replace(samples[0].arm, world=f"{len(samples)} imported worlds")
    return Sample(arm, rows, pairs, samples[0].compared)


def _judge(gate: Gate, sample: Sample, gates: int, time_limit: float) -> GateResult:
    values = _values(gate, sample, time_limit)
    confidence = 1.0 - (1.0 - CONFIDENCE) / gates
    interval = gate.interval(values, confidence)
    verdict = "inconclusive" if interval is None else verdict_of(gate, interval)
    needed = None
    if interval is not None and verdict == "inconclusive":
        needed = gate.worlds_needed(values, interval, tail=(1.0 - confidence) / 2.0)
    worlds = len(set(values.clusters))
    return GateResult(
        gate=gate.text,
        arm=sample.arm,
        verdict=verdict,
        interval=interval,
        gates=gates,
        worlds=worlds,
        worlds_needed=needed,
        required=gate.proven,
        keeps=interval is None or gate.keeps(interval),
        figure=gate.figure,
        sequential=gate.sequential,
        episodes=len(values.second),
    )


def _values(gate: Gate, sample: Sample, time_limit: float) -> Values:
    """Return the values of the gate's figure in the episodes that ran and have the metric."""
    support = METRICS[gate.metric].support.within(time_limit)

    def value(row: Row) -> float | None:
        known = row.metrics[gate.metric]
        if gate.figure == "share with any":
            return None if known is None else float(known > 0.0)
        late = support.timed and known is None and row.way is None  # it did not get there
        counts = gate.figure in ("restricted mean", "worst") and math.isfinite(support.high)
        return support.high if late and counts else known

    if gate.figure == "share with any":
        support = RATE
    if gate.statistic in ("mean", "every"):
        return values_by([row for row in sample.rows if row.ran], value, support)
    ran = [(twin, row) for twin, row in sample.pairs if twin.ran and row.ran]
    if gate.statistic == "drop":
        ran = [(row, twin) for twin, row in ran]
    return paired_values_by(ran, value, support)


def verdict_of(gate: Gate, interval: Interval) -> Verdict:
    """Return `held` or `failed` if the whole interval keeps or breaks the bound."""
    low, high = interval.low, interval.high
    if high <= gate.bound if gate.at_most else low >= gate.bound:
        return "held"
    return "failed" if (low > gate.bound if gate.at_most else high < gate.bound) else "inconclusive"


def interval_in_words(interval: Interval, form: str = ".3f") -> str:
    """Return an estimate and the ends of its interval in words."""
    if math.isinf(interval.low) and math.isinf(interval.high):
        return f"{interval.estimate:{form}} (unbounded)"
    low, high = (
        "unbounded" if math.isinf(end) else f"{end:{form}}" for end in (interval.low, interval.high)
    )
    return f"{interval.estimate:{form}} ({low} to {high})"


def estimate_in_words(result: GateResult) -> str:
    """Return what a gate bounds, where it is not the mean, with its interval; empty without one."""
    if result.interval is None:
        return ""
    figure = "" if result.figure == "mean" else f"{result.figure} "
    return figure + interval_in_words(result.interval)


def gate_in_words(result: GateResult) -> str:
    """Return the line of a gate behind its verdict."""
    text = f"{result.gate} for {name_of(result.arm)}: "
    if result.interval is None:
        return f"{text}no episode has this figure"
    if result.figure == "worst":
        episodes = "the episode" if result.episodes == 1 else f"{result.episodes} episodes"
        return f"{text}worst of {episodes} {result.interval.estimate:.3f}"
    worlds = "1 world" if result.worlds == 1 else f"{result.worlds} worlds"
    coverage = "95 %" if result.gates == 1 else f"simultaneous 95 % over {result.gates} gates"
    coverage += " at every look" if result.sequential else ""
    text += f"{estimate_in_words(result)}, {coverage}, {worlds}"
    advice = gate_advice(result)
    return f"{text}; {advice}" if advice else text


def gate_advice(result: GateResult) -> str:
    """Return advice on deciding an inconclusive gate; empty for any other."""
    if result.verdict != "inconclusive":
        return ""
    if result.interval is None:
        return "no episode has this figure"
    if result.worlds_needed is None:
        return "the estimate is at the bound: no number of worlds would decide it"
    shown = "held" if result.keeps else "failed"
    return f"about {result.worlds_needed} worlds would show it {shown} if the estimate stayed"
