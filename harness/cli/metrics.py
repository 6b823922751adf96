"""Metrics of an episode, computed from its log alone, for `wayproof explain --metrics`."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from wayproof.harness.cli.verb import Document

if TYPE_CHECKING:
    from wayproof.harness.log.reader import Log
    from wayproof.harness.metrics import Metric

SHOWN_OF_RECORDING = {
    "ahead_share": "",
    "driven_m": "m",
    "hindsight_m": "m",
    "least_clearance_m": "m",
    "stopped_s": "s",
    "map_mib": "MiB",
}
"""Figures of a recording's assessment in the table, with their units."""


def print_metrics(log: Log, options: argparse.Namespace, console: Console) -> Document:
    """Print the metrics of a log as a table; those of a recording with its assessment."""
    from wayproof.harness.clearance import true_clearance_is_bound
    from wayproof.harness.metrics import METRICS, least_clearance, score
    from wayproof.harness.trace import read_trace

    trace = read_trace(log)
    scores, is_bound = score(trace), true_clearance_is_bound(least_clearance(trace))
    document = {
        "log": str(log.path),
        "outcome": log.result["outcome"],
        "metrics": scores,
        "least_clearance_is_bound": is_bound,
    }
    assessed = _assessed(log, options) if trace.recorded else {}
    if assessed:
        document["recording"] = assessed
        scores["admitted_share"] = assessed["admitted_share"]
    rows = [(name, value, METRICS[name].unit) for name, value in scores.items()]
    if assessed:
        rows += [(name, assessed[name], unit) for name, unit in SHOWN_OF_RECORDING.items()]
    table = Table(title=f"{log.path}: {log.result['outcome']}", title_justify="left")
    table.add_column("metric")
    table.add_column("value", justify="right")
    table.add_column("unit")
    if options.long:
        table.add_column("formula and source")
    for name, value, unit in rows:
        text = "-" if value is None else f"{value:.3f}"
        if name == "least_clearance" and is_bound:
            text = f">= {text}"
        about = summary_of(METRICS[name]) if name in METRICS else ""
        table.add_row(name, text, unit, *[about] * options.long)
    console.print(table)
    return document


def _assessed(log: Log, options: argparse.Namespace) -> Document:
    """Return the assessment of a recording's way."""
    from wayproof.harness.shadow.assess import assess
    from wayproof.harness.shadow.summary import summarize

    return asdict(summarize(assess(log.path, options.allow_plugins)))


def summary_of(metric: Metric) -> str:
    """Return the formula and the source of a metric, from its docstring."""
    return " ".join((metric.function.__doc__ or "").split())
