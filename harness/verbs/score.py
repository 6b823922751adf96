"""`wayproof score`: an episode's metrics again, from its log alone."""

from __future__ import annotations

import argparse

from rich.console import Console
from rich.table import Table

from harness.verbs.verb import Document, Verb, add_log_paths, one_or_all


def run(options: argparse.Namespace, console: Console) -> tuple[int, Document]:
    """Score one or more logs."""
    from harness.logs.reader import open_log
    from harness.metrics import METRICS, read_trace, score

    documents: list[Document] = []
    for path in options.log:
        log = open_log(path, options.allow_plugins)
        scores = score(read_trace(log))
        documents.append({"log": str(path), "outcome": log.result["outcome"], "metrics": scores})
        table = Table(title=f"{path}: {log.result['outcome']}", title_justify="left")
        table.add_column("metric")
        table.add_column("value", justify="right")
        table.add_column("unit")
        for name, value in scores.items():
            text = "-" if value is None else f"{value:.3f}"
            table.add_row(name, text, METRICS[name].unit)
        console.print(table)
    return 0, one_or_all("scores", documents)


VERB = Verb(
    help="an episode's metrics again, from its log alone",
    add_arguments=add_log_paths,
    run=run,
    example="wayproof score logs/warehouse-drone-3.mcap",
)
