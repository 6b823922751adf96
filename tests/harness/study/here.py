"""Episodes of a study in this process, for tests of what is made of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from wayproof.harness.study.job import Job, run_job
from wayproof.harness.study.plan import reference_of
from wayproof.harness.study.processes import Finished, ProcessEngine
from wayproof.harness.study.rows import Row
from wayproof.harness.worker_pool import Bounds


def paired(rows: Sequence[Row], variant: str = "", stack: str = "") -> list[Row]:
    """Return rows made by hand with the arms that they are compared with, as a plan gives them."""
    return [replace(row, reference=reference_of(row.arm, variant, stack)) for row in rows]


def run_here(jobs: Sequence[Job], stacks: Sequence[bytes], finished: Finished) -> None:
    """Run every job in turn, as an engine of `run_study`; tests/harness/study/test_study.py tests
    the one with worker processes.
    """
    for job in jobs:
        finished(run_job(job))


def run_in_processes(
    jobs: Sequence[Job],
    stacks: Sequence[bytes],
    finished: Finished,
    *,
    workers: int,
    bounds: Bounds,
) -> None:
    """Run every job in worker processes that end with the last job."""
    with ProcessEngine(workers, bounds) as engine:
        engine(jobs, stacks, finished)
