"""What `wayproof bench STAGE` measures: how fast one stage is, and that it is right meanwhile.

A stage is one function from (repeats, seed, progress) to flat rows, and one line of `STAGES`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

from rich import box
from rich.console import Console, JustifyMethod
from rich.table import Table

from wayproof.harness.bench.episodes.ablations import bench_delays, bench_planners, bench_policies
from wayproof.harness.bench.episodes.crossing import bench_crossing
from wayproof.harness.bench.episodes.falsify import bench_falsify
from wayproof.harness.bench.episodes.robots import PARTS as ROBOT_PARTS
from wayproof.harness.bench.episodes.robots import bench_robots
from wayproof.harness.bench.episodes.study import bench_study, bench_study_size
from wayproof.harness.bench.episodes.worlds import bench_worlds
from wayproof.harness.bench.micro.loop import LOADS, bench_loop
from wayproof.harness.bench.micro.map import PARTS as MAP_PARTS
from wayproof.harness.bench.micro.map import bench_map
from wayproof.harness.bench.micro.plan import bench_plan
from wayproof.harness.bench.micro.rays import bench_rays
from wayproof.harness.bench.published import BENCHMARKS, Files, find_benchmark
from wayproof.harness.bench.statistics.coverage import PARTS as COVERAGE_PARTS
from wayproof.harness.bench.statistics.coverage import bench_coverage
from wayproof.harness.errors import InputError, unknown_name

Row = dict[str, Any]


class Stage(NamedTuple):
    """One thing that can be measured.

    Attributes:
        measure: From (repeats, seed, progress) to rows; from a file of kept rows too if it `keeps`.
        repeats: By default: sweeps, whole episodes, or fourteen queries each.
        keeps: Whether it can go on from a file of the rows so far.
        parts: Names of parts of which one can be measured alone.
    """

    measure: Callable[..., list[Row]]
    repeats: int
    keeps: bool = False
    parts: Collection[str] = ()


STAGES: dict[str, Stage] = {
    "coverage": Stage(bench_coverage, 1000, parts=COVERAGE_PARTS),
    "crossing": Stage(bench_crossing, 10, keeps=True),
    "delays": Stage(bench_delays, 2),
    "loop": Stage(bench_loop, 3, parts=LOADS),
    "map": Stage(bench_map, 15, parts=MAP_PARTS),
    "plan": Stage(bench_plan, 15),
    "planners": Stage(bench_planners, 12),
    "policies": Stage(bench_policies, 6),
    "rays": Stage(bench_rays, 15),
    "worlds": Stage(bench_worlds, 3, keeps=True),
    "robots": Stage(bench_robots, 10, parts=ROBOT_PARTS),
    "falsify": Stage(bench_falsify, 10),
    "study": Stage(bench_study, 40),
    "study_size": Stage(bench_study_size, 1000),
}

MOST_REPEATS = 1000

SHORT_HEADINGS = {
    "mray_per_s": "Mray/s",
    "id_mismatches": "ids differ",
    "resolution_m": "cell m",
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
}
"""Of fields whose name is too wide for a table of 80 columns."""


def run_stage(
    name: str,
    repeats: int | None,
    seed: int,
    files: Files | None = None,
    kept: Path | None = None,
    only: str | None = None,
) -> list[Row]:
    """Measure one stage; its figures depend on the machine, its scenes on the seed alone.

    Args:
        name: In `STAGES`, or in `harness.bench.published.BENCHMARKS` where files are given.
        repeats: None for as many as the stage needs.
        seed: Of the scenes.
        files: Of a published benchmark.
        kept: File of the rows so far, from which the stage goes on.
        only: The part that is measured alone.

    Raises:
        InputError: No such stage or part; too few or too many repeats; a negative seed; files
            that cannot be used.
    """
    stage = _from_files(name, files) if files else _find_stage(name)
    if kept is not None:
        stage = _from_rows(name, stage, kept)
    if only is not None:
        stage = _part_of(name, stage, only)
    repeats = stage.repeats if repeats is None else repeats
    if not 1 <= repeats <= MOST_REPEATS:
        raise InputError(f"repeats: got {repeats}, expected 1 to {MOST_REPEATS}")
    if seed < 0:
        raise InputError(f"seed: got {seed}, expected an integer >= 0")
    try:
        return stage.measure(repeats, seed, _show_progress)
    finally:
        _show_progress("")


def _find_stage(name: str) -> Stage:
    if name in BENCHMARKS and name not in STAGES:
        raise InputError(
            f"bench {name}: expected {BENCHMARKS[name].option} with the path of its files"
        )
    if name not in STAGES:
        raise unknown_name("stage", name, STAGES)
    return STAGES[name]


def _from_files(name: str, files: Files) -> Stage:
    one = find_benchmark(name, files.option)
    return Stage(partial(one.measure, files), one.repeats)


def _from_rows(name: str, stage: Stage, kept: Path) -> Stage:
    if not stage.keeps:
        able = ", ".join(key for key, one in STAGES.items() if one.keeps)
        raise InputError(f"--rows: got bench {name}, expected one of: {able}")
    return stage._replace(measure=partial(stage.measure, kept=kept))


def _part_of(name: str, stage: Stage, only: str) -> Stage:
    if not stage.parts:
        able = ", ".join(key for key, one in STAGES.items() if one.parts)
        raise InputError(f"--only: got bench {name}, expected one of: {able}")
    if only not in stage.parts:
        raise unknown_name(f"part of bench {name}", only, stage.parts)
    return stage._replace(measure=partial(stage.measure, only=only))


def print_rows(console: Console, title: str, rows: list[Row]) -> None:
    """Rows as tables, one column for each field; rows with the same fields told share one."""
    for fields, alike in groupby(rows, _fields_told):
        told = [{field: row[field] for field in fields} for row in alike]
        console.print(_table(title, told))
        title = ""


def _fields_told(row: Row) -> tuple[str, ...]:
    return tuple(field for field, value in row.items() if value is not None)


def _table(title: str, rows: list[Row]) -> Table:
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


def _cell(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _show_progress(line: str) -> None:
    """Rewrite one line; no spinner, because its thread would run while something is timed."""
    if sys.stderr.isatty():
        print(f"\r\x1b[2K{line}", end="", file=sys.stderr, flush=True)
