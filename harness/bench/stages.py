"""Registry and runner of the benchmarks of `wayproof bench STAGE`.

A stage is one function from (repeats, seed, progress) to flat rows, and one line of `STAGES`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from wayproof.harness.bench.episodes.ablations import bench_delays, bench_planners, bench_policies
from wayproof.harness.bench.episodes.crossing import bench_crossing
from wayproof.harness.bench.episodes.halls import SIDES, bench_halls
from wayproof.harness.bench.episodes.robots import PARTS as ROBOT_PARTS
from wayproof.harness.bench.episodes.robots import bench_robots
from wayproof.harness.bench.episodes.study import bench_study, bench_study_size
from wayproof.harness.bench.episodes.worlds import bench_worlds
from wayproof.harness.bench.micro.gym import bench_gym
from wayproof.harness.bench.micro.interface import bench_interface
from wayproof.harness.bench.micro.loop import LOADS, bench_loop
from wayproof.harness.bench.micro.map import PARTS as MAP_PARTS
from wayproof.harness.bench.micro.map import bench_map
from wayproof.harness.bench.micro.plan import bench_plan
from wayproof.harness.bench.micro.rays import bench_rays
from wayproof.harness.bench.odometry import bench_odometry
from wayproof.harness.bench.odometry.drift import WORLDS as ODOMETRY_WORLDS
from wayproof.harness.bench.published import BENCHMARKS, Files, find_benchmark
from wayproof.harness.bench.statistics.coverage import PARTS as COVERAGE_PARTS
from wayproof.harness.bench.statistics.coverage import bench_coverage
from wayproof.harness.bench.table import Document, Row, documents
from wayproof.harness.errors import InputError, unknown_name


class Stage(NamedTuple):
    """A benchmark.

    Attributes:
        measure: Function from (repeats, seed, progress) to rows; it also takes `kept`, a file of
            rows, if `keeps` is set, and `only`, the name of a part, if there are `parts`.
        repeats: Default number of sweeps, of episodes, or of batches of fourteen queries.
        keeps: Whether it can continue from a file of rows.
        parts: Names of the parts that can be measured alone.
    """

    measure: Callable[..., Sequence[Row]]
    repeats: int
    keeps: bool = False
    parts: Collection[str] = ()


STAGES: dict[str, Stage] = {
    "coverage": Stage(bench_coverage, 1000, parts=COVERAGE_PARTS),
    "crossing": Stage(bench_crossing, 10, keeps=True),
    "delays": Stage(bench_delays, 2),
    "gym": Stage(bench_gym, 5),
    "halls": Stage(bench_halls, 1, parts=SIDES),
    "interface": Stage(bench_interface, 3),
    "loop": Stage(bench_loop, 3, parts=LOADS),
    "map": Stage(bench_map, 15, parts=MAP_PARTS),
    "odometry": Stage(bench_odometry, 20, parts=ODOMETRY_WORLDS),
    "plan": Stage(bench_plan, 15),
    "planners": Stage(bench_planners, 12),
    "policies": Stage(bench_policies, 6),
    "rays": Stage(bench_rays, 15),
    "worlds": Stage(bench_worlds, 3, keeps=True),
    "robots": Stage(bench_robots, 10, parts=ROBOT_PARTS),
    "study": Stage(bench_study, 40),
    "study_size": Stage(bench_study_size, 1000),
}

MOST_REPEATS = 1000


def run_stage(
    name: str,
    repeats: int | None,
    seed: int,
    files: Files | None = None,
    kept: Path | None = None,
    only: str | None = None,
) -> list[Document]:
    """Measure one stage; its figures depend on the machine, its scenes on the seed alone.

    Args:
        name: Key of `STAGES`; of `BENCHMARKS` in `bench.published` if files are given.
        repeats: Number of repeats; None for the default of the stage.
        seed: Seed of the scenes.
        files: Files of a published benchmark.
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
        return documents(stage.measure(repeats, seed, _show_progress))
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
    benchmark = find_benchmark(name, files.option)
    return Stage(partial(benchmark.measure, files), benchmark.repeats)


def _from_rows(name: str, stage: Stage, kept: Path) -> Stage:
    if not stage.keeps:
        able = ", ".join(key for key, known in STAGES.items() if known.keeps)
        raise InputError(f"--rows: got bench {name}, expected one of: {able}")
    return stage._replace(measure=partial(stage.measure, kept=kept))


def _part_of(name: str, stage: Stage, only: str) -> Stage:
    if not stage.parts:
        able = ", ".join(key for key, known in STAGES.items() if known.parts)
        raise InputError(f"--only: got bench {name}, expected one of: {able}")
    if only not in stage.parts:
        raise unknown_name(f"part of bench {name}", only, stage.parts)
    return stage._replace(measure=partial(stage.measure, only=only))


def _show_progress(line: str) -> None:
    """Rewrite one line; a spinner would need a thread, which would disturb the timing."""
    if sys.stderr.isatty():
        print(f"\r\x1b[2K{line}", end="", file=sys.stderr, flush=True)
