"""Published benchmarks, run on files that the user has: `wayproof bench NAME --worlds DIR`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from wayproof.harness.bench.published.barn import bench_barn
from wayproof.harness.bench.published.dodge import bench_dodge
from wayproof.harness.bench.published.files import Files, Progress
from wayproof.harness.bench.published.voxel_problems import bench_scenarios
from wayproof.harness.errors import unknown_name

Row = dict[str, Any]


class Benchmark(NamedTuple):
    """A published protocol.

    Attributes:
        measure: From (files, repeats, seed, progress) to flat rows.
        repeats: By default: seeds of each world, or problems of each planner compared.
        option: The option that names its files.
    """

    measure: Callable[[Files, int, int, Progress], list[Row]]
    repeats: int
    option: str


BENCHMARKS: dict[str, Benchmark] = {
    "barn": Benchmark(bench_barn, 5, "--worlds"),
    "dodge": Benchmark(bench_dodge, 20, "--worlds"),
    "plan": Benchmark(bench_scenarios, 25, "--scenarios"),
}
"""Name -> protocol on files given by the user."""


def find_benchmark(name: str, option: str) -> Benchmark:
    """The protocol that takes its files by an option.

    Raises:
        InputError: There is none of that name, or it takes them by another option.
    """
    fitting = [key for key, one in BENCHMARKS.items() if one.option == option]
    if name not in fitting:
        raise unknown_name(f"stage with {option}", name, fitting)
    return BENCHMARKS[name]


__all__ = ["BENCHMARKS", "Benchmark", "Files", "find_benchmark"]
