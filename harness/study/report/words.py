"""Words, numbers and sides of verdicts that pages and summaries share."""

from __future__ import annotations

from wayproof.harness.metrics import METRICS
from wayproof.harness.statistics.exact import Interval
from wayproof.harness.study.gates import GateResult, gate_advice, interval_in_words


def gate_reason(gate: GateResult) -> str:
    """Return why a gate has its verdict."""
    if gate.verdict == "inconclusive":
        return gate_advice(gate)
    return f"the whole interval {'keeps' if gate.verdict == 'held' else 'breaks'} the bound"


def side_of(interval: Interval, higher_is_better: bool | None) -> str:
    """Return `good` or `bad` where a whole difference lies on one side of 0."""
    if higher_is_better is None or interval.low <= 0.0 <= interval.high:
        return ""
    return "good" if (interval.low > 0.0) == higher_is_better else "bad"


def heading(metric: str) -> str:
    """Return the name of a metric with its unit."""
    unit = METRICS[metric].unit
    text = metric.replace("_", " ")
    return f"{text}, {unit}" if unit else text


def number(value: float | None, form: str = ".2f") -> str:
    """Format a number; empty for None."""
    return "" if value is None else f"{value:{form}}"


def spread(interval: Interval | None, form: str = ".2f") -> str:
    """Return an estimate and its interval; empty for None."""
    return "" if interval is None else interval_in_words(interval, form)
