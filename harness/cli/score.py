"""`wayproof score`: compute the metrics of an episode from its log alone."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from wayproof.harness.cli.verb import (
    Document,
    Verb,
    add_log_paths,
    add_unchecked,
    check_log,
    one_or_all,
)

if TYPE_CHECKING:
    from wayproof.harness.metrics import Metric


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Score one or more logs."""
    from wayproof.harness.clearance import true_clearance_is_bound
    from wayproof.harness.log.reader import open_log
    from wayproof.harness.metrics import METRICS, least_clearance, score
    from wayproof.harness.trace import read_trace

    documents: list[Document] = []
    for path in options.log:
        check_log(path, options)
        log = open_log(path, options.allow_plugins)
        trace = read_trace(log)
        scores, is_bound = score(trace), true_clearance_is_bound(least_clearance(trace))
        documents.append(
            {
                "log": str(path),
                "outcome": log.result["outcome"],
                "metrics": scores,
                "least_clearance_is_bound": is_bound,
            }
        )
        if trace.recorded:
            documents[-1]["recording"] = assessed = _recording(path, options)
            scores["admitted_share"] = assessed["admitted_share"]
        table = Table(title=f"{path}: {log.result['outcome']}", title_justify="left")
        table.add_column("metric")
        table.add_column("value", justify="right")
        table.add_column("unit")
        if options.long:
            table.add_column("formula and source")
        for name, value in scores.items():
            text = "-" if value is None else f"{value:.3f}"
            if name == "least_clearance" and is_bound:
                text = f">= {text}"
            about = [summary_of(METRICS[name])] if options.long else []
            table.add_row(name, text, METRICS[name].unit, *about)
        for name, value in documents[-1].get("recording", {}).items():
            if name in SHOWN_OF_RECORDING:
                text = "-" if value is None else f"{value:.3f}"
                table.add_row(name, text, SHOWN_OF_RECORDING[name], *[""] * options.long)
        console.print(table)
    return 0, one_or_all("scores", documents)


SHOWN_OF_RECORDING = {
    "ahead_share": "",
    "driven_m": "m",
    "hindsight_m": "m",
    "least_clearance_m": "m",
    "stopped_s": "s",
    "map_mib": "MiB",
}
"""Figures of a recording's assessment in the table, with their units."""


def _recording(path: Path, options: argparse.Namespace) -> Document:
    """Return the assessment of a recording's way."""
    from dataclasses import asdict

    from wayproof.harness.shadow.assess import assess
    from wayproof.harness.shadow.summary import summarize

    return asdict(summarize(assess(path, options.allow_plugins)))


def summary_of(metric: Metric) -> str:
    """Return the formula and the source of a metric, from its docstring."""
    return " ".join((metric.function.__doc__ or "").split())


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    add_log_paths(parser)
    parser.add_argument(
        "--long", action="store_true", help="print the formula and source of each metric as well"
    )
    add_unchecked(parser)


VERB = Verb(
    help="compute the metrics of an episode from its log alone",
    add_arguments=_add_arguments,
    run=run,
    example="wayproof score logs/warehouse-drone-3.mcap",
)
