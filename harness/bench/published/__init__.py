"""Published benchmarks, run on files of the user: `wayproof study NAME --worlds DIR`."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

from wayproof.harness.bench.published.barn import bench_barn
from wayproof.harness.bench.published.dodge import bench_dodge
from wayproof.harness.bench.published.files import Files
from wayproof.harness.bench.table import Row
from wayproof.harness.errors import unknown_name

BENCHMARKS: dict[str, tuple[Callable[..., Sequence[Any]], int]] = {
    "barn": (bench_barn, 5),
    "dodge": (bench_dodge, 20),
}
"""Name -> function from (files, repeats, seed, progress) to rows, default number of seeds."""


def run_published(name: str, files: Files, repeats: int | None) -> list[Row]:
    """Run a published benchmark by its own protocol.

    Raises:
        InputError: There is no such benchmark, or files cannot be used.
    """
    if name not in BENCHMARKS:
        raise unknown_name("benchmark", name, BENCHMARKS)
    measure, most = BENCHMARKS[name]
    found = measure(files, repeats or most, 0, lambda line: None)
    return [dataclasses.asdict(row) for row in found]
