"""Words and sides of verdicts that pages and summaries share."""

from __future__ import annotations

from wayproof.harness.metrics import METRICS
from wayproof.harness.statistics.exact import Interval
from wayproof.harness.study.gates import GateResult, gate_advice


def gate_reason(gate: GateResult) -> str:
    """Return why a gate has its verdict."""
    if gate.verdict == "inconclusive":
        return gate_advice(gate)
    return f"the whole interval {'keeps' if gate.verdict == 'held' else 'breaks'} the bound"


def side_of_drop(drop: Interval) -> str:
    """Return `bad` or `good` where the whole interval of a drop lies on one side of 0."""
    if drop.low > 0.0:
        return "bad"
    return "good" if drop.high < 0.0 else ""


def side_of_difference(metric: str, difference: Interval) -> str:
    """Return `bad` or `good` where a whole difference does, and the metric has a better side."""
    better = METRICS[metric].higher_is_better
    if better is None or difference.low <= 0.0 <= difference.high:
        return ""
    return "good" if (difference.low > 0.0) == better else "bad"


def heading(metric: str) -> str:
    """Return the name of a metric with its unit."""
    unit = METRICS[metric].unit
    text = metric.replace("_", " ")
    return f"{text}, {unit}" if unit else text


def number(value: float | None, digits: int = 2) -> str:
    """Format a number with `digits` digits; empty for None."""
    return "" if value is None else f"{value:.{digits}f}"


def signed(value: float | None, digits: int = 2) -> str:
    """Format a number with `digits` digits and a sign; empty for None."""
    return "" if value is None else f"{value:+.{digits}f}"
