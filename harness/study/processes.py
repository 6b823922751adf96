"""Running jobs on this machine, one process a core; a worker that dies costs one try."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import Any

import pebble

from harness.study.file import Bounds
from harness.study.job import Done, Job, run_job, start_worker, warm_up_job

TRIES = 3
"""Of a job whose worker is killed from outside: the machine is at fault before the job is."""

Finished = Callable[[Done], None]


def run_in_processes(
    jobs: Sequence[Job],
    stacks: Sequence[bytes],
    finished: Finished,
    *,
    workers: int,
    bounds: Bounds,
) -> None:
    """Run every job and tell of each as it ends, in the order of their ends.

    Args:
        jobs: What to run.
        stacks: A config for each kind of stack among them, to be compiled first.
        finished: Called in this process.
        workers: Processes.
        bounds: Of one job.
    """
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    pool = pebble.ProcessPool(
        max_workers=workers,
        context=multiprocessing.get_context("spawn"),
        initializer=start_worker,
        initargs=(bounds.memory_mib, os.getpid()),
    )
    try:
        for future in [pool.schedule(warm_up_job, args=[config]) for config in stacks]:
            future.result()
        _run(pool, jobs, workers, bounds, finished)
    finally:
        pool.stop()
        pool.join()


def _run(
    pool: pebble.ProcessPool, jobs: Sequence[Job], workers: int, bounds: Bounds, finished: Finished
) -> None:
    """Keep a few jobs scheduled ahead, so that a study of any length holds little."""
    waiting = list(reversed([(job, 1) for job in jobs]))
    running: dict[Future[Any], tuple[Job, int]] = {}
    while waiting or running:
        while waiting and len(running) < 2 * workers:
            job, tries = waiting.pop()
            future: Future[Any] = pool.schedule(run_job, args=[job], timeout=bounds.wall_s)
            running[future] = job, tries
        for future in wait(running, return_when=FIRST_COMPLETED).done:
            job, tries = running.pop(future)
            error = future.exception()
            if isinstance(error, pebble.ProcessExpired) and tries < TRIES:
                waiting.append((job, tries + 1))
                continue
            finished(_done(job, future, error, bounds, tries))


def _done(
    job: Job,
    future: Future[Any],
    error: BaseException | None,
    bounds: Bounds,
    tries: int,
) -> Done:
    if error is None:
        return future.result()  # type: ignore[no-any-return]
    if isinstance(error, TimeoutError):
        return Done(job.key, took_too_long(bounds))
    if isinstance(error, pebble.ProcessExpired):
        return Done(job.key, f"its process died {tries} times, last with exit {error.exitcode}")
    raise error


def took_too_long(bounds: Bounds) -> str:
    """What the row of an episode says that was ended for its wall time."""
    return f"took more than the {bounds.wall_s:g} s that bounds.wall_s allows"
