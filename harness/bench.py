"""What `wayproof bench STAGE` measures: how fast one stage is, and that it is right meanwhile.

A stage is one function from (sweeps, seed, progress) to flat rows, and one line of `STAGES`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from rich import box
from rich.console import Console, JustifyMethod
from rich.table import Table

from harness.bench_plan import bench_plan
from harness.bench_rays import bench_rays
from harness.errors import InputError, unknown_name

Row = dict[str, Any]
Stage = Callable[[int, int, Callable[[str], None]], list[Row]]

STAGES: dict[str, Stage] = {"rays": bench_rays, "plan": bench_plan}

MOST_SWEEPS = 1000

SHORT_HEADINGS = {"mray_per_s": "Mray/s", "id_mismatches": "ids differ"}
"""Of fields whose name is too wide for a table of 80 columns."""


def run_stage(name: str, sweeps: int, seed: int) -> list[Row]:
    """Measure one stage; its figures depend on the machine, its scenes on the seed alone.

    Raises:
        InputError: No such stage; too few or too many sweeps; a negative seed.
    """
    if name not in STAGES:
        raise unknown_name("stage", name, STAGES)
    if not 1 <= sweeps <= MOST_SWEEPS:
        raise InputError(f"sweeps: got {sweeps}, expected 1 to {MOST_SWEEPS}")
    if seed < 0:
        raise InputError(f"seed: got {seed}, expected an integer >= 0")
    try:
        return STAGES[name](sweeps, seed, _show_progress)
    finally:
        _show_progress("")


def print_rows(console: Console, title: str, rows: list[Row]) -> None:
    """Rows as a table, one column for each field."""
    style = box.SIMPLE_HEAD
    table = Table(title=title, title_justify="left", box=style, padding=0, show_edge=False)
    for field, value in rows[0].items():
        word = isinstance(value, str)
        heading = SHORT_HEADINGS.get(field, field.replace("_", " "))
        side: JustifyMethod = "left" if word else "right"
        table.add_column(heading, justify=side, no_wrap=word)
    for row in rows:
        table.add_row(*(_cell(value) for value in row.values()))
    console.print(table)


def _cell(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _show_progress(line: str) -> None:
    """Rewrite one line; no spinner, because its thread would run while something is timed."""
    if sys.stderr.isatty():
        print(f"\r\x1b[2K{line}", end="", file=sys.stderr, flush=True)
