"""What this machine does with rays, maps, plans, whole episodes and robots: `wayproof bench PART`.

A benchmark is one function from (repeats, seed, progress) to rows and one line of `BENCHES`. What
is compared takes turns within each repeat, so that the load of the machine meets all alike: compare
two commits by the ratio to the peer of the same run, or by the least time.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import NamedTuple

from wayproof.harness.bench.loop import bench_loop
from wayproof.harness.bench.map import bench_map
from wayproof.harness.bench.plan import bench_plan
from wayproof.harness.bench.rays import bench_rays
from wayproof.harness.bench.robots import bench_robots
from wayproof.harness.bench.table import Progress, Row
from wayproof.harness.errors import InputError, unknown_name


class Bench(NamedTuple):
    """A benchmark: function from (repeats, seed, progress) to rows, and its default of repeats."""

    measure: Callable[[int, int, Progress], list[Row]]
    repeats: int


BENCHES: dict[str, Bench] = {
    "rays": Bench(bench_rays, 15),
    "map": Bench(bench_map, 15),
    "plan": Bench(bench_plan, 30),
    "loop": Bench(bench_loop, 3),
    "robots": Bench(bench_robots, 5),
}

MOST_REPEATS = 1000


def run_bench(name: str, repeats: int | None, seed: int) -> list[Row]:
    """Measure one part; its figures depend on the machine, its scenes on the seed alone.

    Args:
        name: Key of `BENCHES`.
        repeats: Number of repeats; None for the default.
        seed: Seed of the scenes.

    Raises:
        InputError: No such part, too few or too many repeats, a negative seed.
    """
    if name not in BENCHES:
        raise unknown_name("part", name, BENCHES)
    repeats = BENCHES[name].repeats if repeats is None else repeats
    if not 1 <= repeats <= MOST_REPEATS:
        raise InputError(f"repeats: got {repeats}, expected 1 to {MOST_REPEATS}")
    if seed < 0:
        raise InputError(f"seed: got {seed}, expected an integer >= 0")
    try:
        return BENCHES[name].measure(repeats, seed, _show_progress)
    finally:
        _show_progress("")


def _show_progress(line: str) -> None:
    """Rewrite one line; a spinner would need a thread, which would disturb the timing."""
    if sys.stderr.isatty():
        print(f"\r\x1b[2K{line}", end="", file=sys.stderr, flush=True)
