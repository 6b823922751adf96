"""Rows of measurements as tables on the console."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import groupby
from typing import Any

from rich import box
from rich.console import Console, JustifyMethod
from rich.table import Table

Progress = Callable[[str], None]
"""Callback for a line about the progress."""

Row = dict[str, Any]
"""One line of a table: plain values by field."""


def print_rows(console: Console, title: str, rows: Sequence[Row]) -> None:
    """Print rows; neighbouring rows with the same fields share a table."""
    for fields, alike in groupby(rows, tuple):
        style = box.SIMPLE_HEAD
        table = Table(title=title, title_justify="left", box=style, padding=0, show_edge=False)
        some = list(alike)
        for field in fields:
            word = isinstance(some[0][field], str)
            side: JustifyMethod = "left" if word else "right"
            table.add_column(field.replace("_", " "), justify=side, no_wrap=word)
        for row in some:
            table.add_row(*(_cell(value) for value in row.values()))
        console.print(table)
        title = ""


def _cell(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)
