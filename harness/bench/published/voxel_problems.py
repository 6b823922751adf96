"""`wayproof bench plan --scenarios FILE`: published planning problems on a published voxel map.

An exact search with the benchmark's own moves has to find every published optimal length; the
planners that robots use here are then compared with those lengths on problems taken evenly from the
file. They may go straight in any direction, so a ratio below 1 is no error.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.bench.micro.plan import REACH, squared_distances
from wayproof.harness.bench.published.files import Files
from wayproof.harness.bench.published.voxel_search import Moves, VoxelSearch
from wayproof.harness.bench.table import Progress
from wayproof.harness.errors import InputError
from wayproof.models.world_files.reading import WorldFileError, beside, read_text
from wayproof.models.world_files.voxel_maps import read_voxels
from wayproof.planners import FreeSpace, PlannerConfig, plan, plan_seed, warm_up

Cell = tuple[int, int, int]

RESOLUTION = 0.1
"""Cell size of the map for the planners, m."""

TOLERANCE = 1e-6
"""Tolerance of a length against the published one, which has eight decimals, cells."""

SLAB = 64
"""Cells along x of which distances are worked out at once."""

COMPARED = ("astar", "rrtconnect")
VERSION = "version 1"


@dataclass(frozen=True)
class Problem:
    """One line of a `.3dscen`: from cell to cell, and the length of a shortest way in cells."""

    start: Cell
    goal: Cell
    length: float


@dataclass(frozen=True)
class ProblemsRow:
    """Results of one planner.

    Attributes:
        map: The map's file name.
        planner: `exact`, or a name in `planners.PLANNERS`.
        problems: Number of problems.
        success: Share of them that it solved.
        differing: Number of its lengths that are not the published ones; of the exact search.
        length_ratio_mean: Mean ratio to the published length of solved problems; None without any.
        length_ratio_p99: 99th percentile of the ratio.
        p50_ms: Median processor time of a problem, ms.
        p99_ms: 99th percentile of the processor time, ms.
    """

    map: str
    planner: str
    problems: int
    success: float
    differing: int | None
    length_ratio_mean: float | None
    length_ratio_p99: float | None
    p50_ms: float
    p99_ms: float


def bench_scenarios(files: Files, repeats: int, seed: int, progress: Progress) -> list[ProblemsRow]:
    """Solve `repeats` problems of a file, taken evenly, exactly and by each planner compared.

    Raises:
        InputError: The file or its map cannot be read.
    """
    map_name, occupied, problems = read_problems(files.path)
    places = np.linspace(0, len(problems) - 1, min(repeats, len(problems))).astype(int)
    sample = [problems[place] for place in places]
    progress(f"plan: {map_name}, {len(sample)} of {len(problems)} problems, exact")
    search = VoxelSearch(occupied)
    search.solve(problems[0].start, problems[0].goal)  # compiles
    rows = [_exact_row(map_name, search, sample, progress)]
    del search  # its memory is for the planners
    space = _space(occupied)
    for name in COMPARED:
        progress(f"plan: {map_name}, {name}")
        config = PlannerConfig(name=name, clearance_weight=0.0)
        warm_up(config)
        rows.append(_planner_row(map_name, space, problems=sample, config=config, seed=seed))
    return rows


def read_problems(path: Path) -> tuple[str, NDArray[np.bool_], list[Problem]]:
    """Return the map's name, its occupied cells (nx, ny, nz), and the problems on it.

    Raises:
        InputError: Naming the file, the line and what was expected there.
    """
    try:
        lines = read_text(path).splitlines()
        if lines[0].strip() != VERSION or len(lines) < 3:
            raise WorldFileError(
                path, f"got '{lines[0][:60]}', expected '{VERSION}', a map, problems"
            )
        name = lines[1].strip()
        occupied = read_voxels(beside(path, name))
        numbered = [(n, line) for n, line in enumerate(lines[2:], start=3) if line.strip()]
        return name, occupied, [_problem(path, n, line, occupied) for n, line in numbered]
    except WorldFileError as error:
        raise InputError(str(error)) from None


def _problem(path: Path, number: int, line: str, occupied: NDArray[np.bool_]) -> Problem:
    words = line.split()
    try:
        x, y, z, u, v, w = (int(word) for word in words[:6])
        problem = Problem((x, y, z), (u, v, w), float(words[6]))
    except (ValueError, IndexError):
        raise WorldFileError(
            path, "expected start x y z, goal x y z and a length", number
        ) from None
    for cell in (problem.start, problem.goal):
        inside = all(0 <= at < size for at, size in zip(cell, occupied.shape, strict=True))
        if not inside or occupied[cell]:
            raise WorldFileError(path, f"cell {cell} is occupied or outside the map", number)
    if not 0.0 < problem.length < np.inf:
        raise WorldFileError(path, f"length {problem.length}, expected above 0", number)
    return problem


def _space(occupied: NDArray[np.bool_]) -> FreeSpace:
    """Return the map for a body that is a point."""
    field = np.empty(occupied.shape, np.uint16)
    for first in range(0, len(occupied), SLAB):  # a whole map takes 40 bytes a cell on the way
        low, high = max(first - REACH, 0), first + SLAB + REACH
        near = occupied[low:high]
        inner = slice(first - low, first - low + SLAB)
        known = squared_distances(near)[inner] if near.any() else REACH * REACH
        field[first : first + SLAB] = known
    return FreeSpace(
        field,
        origin=np.zeros(3),
        resolution=RESOLUTION,
        collision_distance_sq=0,
        cost_by_distance=np.zeros(REACH * REACH + 1),
    )


def _exact_row(
    name: str, search: VoxelSearch, problems: list[Problem], progress: Progress
) -> ProblemsRow:
    times, ways = [], []
    for number, problem in enumerate(problems):
        if number % 5 == 0:
            progress(f"plan: {name}, exact, {number} of {len(problems)}")
        began = time.process_time()
        ways.append(search.solve(problem.start, problem.goal))
        times.append(time.process_time() - began)
    lengths = [np.inf if way is None else way.length for way in ways]
    off = sum(_is_off(way, problem) for way, problem in zip(ways, problems, strict=True))
    return _row(
        name, planner="exact", problems=problems, lengths=lengths, times=times, differing=off
    )


def _is_off(way: Moves | None, problem: Problem) -> bool:
    return way is None or abs(way.length - problem.length) > TOLERANCE


def _planner_row(
    name: str, space: FreeSpace, problems: list[Problem], config: PlannerConfig, seed: int
) -> ProblemsRow:
    times, lengths = [], []
    for number, problem in enumerate(problems):
        start, goal = ((np.array(at) + 0.5) * RESOLUTION for at in (problem.start, problem.goal))
        began = time.process_time()
        found = plan(space, start, goal, config, plan_seed(seed, "voxels", number))
        times.append(time.process_time() - began)
        lengths.append(found.length / RESOLUTION)
    return _row(
        name, planner=config.name, problems=problems, lengths=lengths, times=times, differing=None
    )


def _row(
    name: str, planner: str, problems: list[Problem], lengths: list[float], times: list[float],
    differing: int | None,
) -> ProblemsRow:  # fmt: skip
    ratios = np.array(lengths) / [problem.length for problem in problems]
    solved = ratios[np.isfinite(ratios)]
    p50, p99 = 1e3 * np.percentile(times, [50, 99])
    return ProblemsRow(
        map=name,
        planner=planner,
        problems=len(problems),
        success=len(solved) / len(problems),
        differing=differing,
        length_ratio_mean=float(solved.mean()) if len(solved) else None,
        length_ratio_p99=float(np.percentile(solved, 99)) if len(solved) else None,
        p50_ms=float(p50),
        p99_ms=float(p99),
    )
