"""Published benchmarks, run on files of the user: `wayproof bench NAME --worlds DIR`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from wayproof.harness.bench.published.barn import bench_barn
from wayproof.harness.bench.published.dodge import bench_dodge
from wayproof.harness.bench.published.files import Files
from wayproof.harness.bench.published.voxel_problems import bench_scenarios
from wayproof.harness.bench.table import Progress, Row
from wayproof.harness.errors import unknown_name


class Benchmark(NamedTuple):
    """The protocol of a published benchmark.

    Attributes:
        measure: Function from (files, repeats, seed, progress) to flat rows.
        repeats: Default number of seeds of each world, or of problems for each planner.
        option: Command-line option that names its files.
    """

    measure: Callable[[Files, int, int, Progress], Sequence[Row]]
    repeats: int
    option: str


BENCHMARKS: dict[str, Benchmark] = {
    "barn": Benchmark(bench_barn, 5, "--worlds"),
    "dodge": Benchmark(bench_dodge, 20, "--worlds"),
    "plan": Benchmark(bench_scenarios, 25, "--scenarios"),
}
"""Name -> protocol."""


def find_benchmark(name: str, option: str) -> Benchmark:
    """Return the benchmark of a name that takes its files by an option.

    Raises:
        InputError: There is none of that name, or it takes them by another option.
    """
    fitting = [key for key, known in BENCHMARKS.items() if known.option == option]
    if name not in fitting:
        raise unknown_name(f"stage with {option}", name, fitting)
    return BENCHMARKS[name]


__all__ = ["BENCHMARKS", "Benchmark", "Files", "find_benchmark"]
