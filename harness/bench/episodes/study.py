"""`wayproof bench study` and `wayproof bench study_size`: overhead of a study.

`study` runs the same short episodes in one process, in two, and on two workers of Ray if it is
installed. `study_size` runs a given number of episodes and reports, part by part, the time of an
episode and the memory of the study's process and its workers.
"""

from __future__ import annotations

import functools
import importlib.util
import tempfile
import time
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import msgspec

from wayproof.harness.bench.table import Document, Progress
from wayproof.harness.errors import InputError
from wayproof.harness.study.file import StudyFile
from wayproof.harness.study.job import Done
from wayproof.harness.study.plan import plan_episodes
from wayproof.harness.study.processes import run_in_processes
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import Engine, read_rows, run_study
from wayproof.harness.worker_pool import Bounds

LEAST = 4
"""Least number of episodes of `study`."""

ROUNDS = 3
"""Number of rounds, in each of which every engine runs once."""

PARTS = 10
"""Number of parts of a large study that are reported separately."""


def brief_study(episodes: int, first: int, seconds: float) -> StudyFile:
    """Return a study of short episodes of drones in an empty room, without sweeps in the logs."""
    return StudyFile(
        name="brief",
        worlds=["empty"],
        robots=["drone"],
        seeds=list(range(first, first + episodes)),
        settings={"episode.time_limit": seconds, "record": "decisions"},
    )


def bench_study(repeats: int, seed: int, progress: Progress) -> list[Document]:
    """Measure episodes per hour of each engine, with `repeats` episodes of 10 s in each round.

    Engines alternate, so that a change of the machine's speed does not favour one. Only episodes
    that end while every worker is busy count, after the first of each worker: a study starts once,
    and waits once for its last episode.

    Raises:
        InputError: There are too few episodes to time.
    """
    from wayproof.harness.study.cluster import run_on_ray

    if repeats < LEAST:
        raise InputError(f"--repeats {repeats}: expected at least {LEAST} episodes")

    bounds = Bounds()
    engines: dict[str, Engine] = {
        "one process": functools.partial(run_in_processes, workers=1, bounds=bounds),
        "two processes": functools.partial(run_in_processes, workers=2, bounds=bounds),
    }
    if importlib.util.find_spec("ray") is not None:
        engines["two workers of Ray"] = functools.partial(run_on_ray, workers=2, bounds=bounds)
    runs: dict[str, list[Run]] = {name: [] for name in engines}
    for turn in range(ROUNDS):
        for name, engine in engines.items():
            progress(f"{name}: {repeats} episodes, round {turn + 1} of {ROUNDS}")
            workers = 1 if name == "one process" else 2
            runs[name].append(_timed(engine, workers, brief_study(repeats, seed, 10.0)))
    rows = [_row(name, done) for name, done in runs.items()]
    for row in rows:
        row["ratio_to_one"] = row["episodes_per_hour"] / rows[0]["episodes_per_hour"]
        row["ratio_to_two"] = row["episodes_per_hour"] / rows[1]["episodes_per_hour"]
    return rows


class Run(NamedTuple):
    """Timing of a study; steady: while every worker is busy, after its first episode."""

    errors: int
    to_first_s: float
    steady_episodes: int
    steady_s: float


def _timed(engine: Engine, workers: int, study: StudyFile) -> Run:
    ends: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        planned = plan_episodes(study)
        result = run_study(
            study,
            planned,
            Store(Path(folder)),
            engine,
            finished=lambda done: ends.append(time.perf_counter()),
        )
    steady = ends[-workers] - ends[workers - 1]
    return Run(result.errors, ends[0] - began, len(ends) - 2 * workers + 1, steady)


def _row(name: str, runs: list[Run]) -> Document:
    episodes, seconds = sum(run.steady_episodes for run in runs), sum(run.steady_s for run in runs)
    return {
        "engine": name,
        "episodes": episodes,
        "errors": sum(run.errors for run in runs),
        "to_first_s": min(run.to_first_s for run in runs),
        "episodes_per_hour": 3600.0 * episodes / seconds,
    }


def bench_study_size(repeats: int, seed: int, progress: Progress) -> list[Document]:
    """Measure a study of `repeats` episodes of 1 s in two processes, in parts, and its table."""
    study = brief_study(repeats, seed, 1.0)
    ends: list[float] = []
    memory: list[tuple[float, float]] = []

    def finished(done: Done) -> None:
        ends.append(time.perf_counter())
        memory.append(memory_mib())
        progress(f"{len(ends)} of {repeats} episodes")

    engine = functools.partial(run_in_processes, workers=2, bounds=Bounds())
    with tempfile.TemporaryDirectory() as folder:
        store = Store(Path(folder))
        planned = plan_episodes(study)
        began = time.perf_counter()
        run_study(study, planned, store, engine, finished)
        judged = time.perf_counter()
        rows = read_rows(planned, store)
        encoded = msgspec.json.encode([row.metrics for row in rows])
        read = time.perf_counter()
        size = sum(path.stat().st_size for path in store.logs.glob("*.mcap"))
    parts = min(PARTS, repeats)
    edges = [round(part * repeats / parts) for part in range(parts + 1)]
    table = []
    for first, last in pairwise(edges):
        start = ends[first - 1] if first else began
        table.append({
            "up_to": last,
            "s_per_episode": (ends[last - 1] - start) / (last - first),
            "own_mib": max(own for own, _ in memory[first:last]),
            "workers_mib": max(workers for _, workers in memory[first:last]),
        })  # fmt: skip
    whole = {
        "episodes": len(rows),
        "most_mib": max(own + workers for own, workers in memory),
        "rows_s": (judged - ends[-1]),
        "read_again_s": read - judged,
        "log_kib_per_episode": size / 1024 / repeats,
        "table_bytes": len(encoded),
    }
    return [*table, whole]


def memory_mib() -> tuple[float, float]:
    """Return the resident memory of this process and of all its children, MiB."""
    import os

    own, children = 0.0, 0.0
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            status = (entry / "status").read_text()
        except OSError:
            continue
        fields = dict(line.split(":", 1) for line in status.splitlines() if ":" in line)
        resident = int(fields.get("VmRSS", "0 kB").split()[0]) / 1024
        if int(entry.name) == os.getpid():
            own = resident
        elif int(fields["PPid"]) == os.getpid():
            children += resident
    return own, children
