"""Rows of benchmarks as tables on the console and as documents for `--json`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from itertools import groupby
from typing import TYPE_CHECKING, Any, TypeAlias

from rich import box
from rich.console import Console, JustifyMethod
from rich.table import Table

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Progress = Callable[[str], None]
"""Callback for a line about the progress."""

Document = dict[str, Any]
"""A row as plain values by field."""

Row: TypeAlias = "DataclassInstance | Document"
"""One line of a table: a frozen dataclass, or a document where the fields depend on the data."""

SHORT_HEADINGS = {
    "mray_per_s": "Mray/s",
    "id_mismatches": "ids differ",
    "resolution_m": "cell",
    "ms_per_sweep": "ms",
    "ms_p99": "p99",
    "ratio_vs_pyoctomap": "ratio",
    "trajectory_m": "path m",
    "floor_columns_lost": "floor lost",
    "agreement": "agree",
    "optimal_s": "OT s",
    "clearance_m": "clear m",
    "least_clearance_m": "clear m",
    "episodes": "runs",
    "success": "ok",
    "edge_share": "edge",
    "unknown_share": "unkn",
    "unknown_cells": "cells",
    "collisions": "hits",
    "speed_m_s": "m/s",
    "length_m": "m",
    "plan_ms_p50": "ms",
    "plan_ms_p99": "p99",
    "agreement_above_floor": "above floor",
    "solids": "n",
    "path_ratio": "path",
    "path_ratio_max": "most",
    "cpu_ms_p50": "ms",
    "cpu_ms_p99": "p99",
    "cpu_ms_max": "max",
    "costmap_ms": "cost",
    "loop_share": "share",
    "share_of_physics": "share",
    "reached": "ok",
    "threads": "cpu",
    "realtime_factor": "real",
    "physics_realtime_factor": "bare",
    "sense_ms": "cast",
    "map_ms": "map",
    "plan_ms": "plan",
    "decision_ms_p50": "ms",
    "decision_ms_p99": "p99",
    "build_s": "init s",
    "memory_mib": "MiB",
}
"""Heading of a field whose name is too wide for a table of 80 columns."""


def documents(rows: Iterable[Row]) -> list[Document]:
    """Return rows as plain values by field, in the order of the fields."""
    return [row if isinstance(row, dict) else asdict(row) for row in rows]


def print_rows(console: Console, title: str, rows: Sequence[Row]) -> None:
    """Print rows as tables with a column for each field that is not None.

    Neighbouring rows with the same such fields share a table.
    """
    for fields, alike in groupby(documents(rows), _present_fields):
        console.print(_table(title, [{field: row[field] for field in fields} for row in alike]))
        title = ""


def _present_fields(row: Document) -> tuple[str, ...]:
    return tuple(field for field, value in row.items() if value is not None)


def _table(title: str, rows: list[Document]) -> Table:
    style = box.SIMPLE_HEAD
    table = Table(title=title, title_justify="left", box=style, padding=0, show_edge=False)
    for field, value in rows[0].items():
        word = isinstance(value, str)
        heading = SHORT_HEADINGS.get(field, field.replace("_", " "))
        side: JustifyMethod = "left" if word else "right"
        table.add_column(heading, justify=side, no_wrap=word)
    for row in rows:
        table.add_row(*(_cell(value) for value in row.values()))
    return table


def _cell(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
