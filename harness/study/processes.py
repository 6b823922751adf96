"""Running jobs on this machine, one process a core; a worker that dies costs one try."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any

import msgspec
import pebble

from wayproof.harness.errors import InputError
from wayproof.harness.study.file import Bounds
from wayproof.harness.study.job import Done, Job, run_job, start_worker, warm_up_job

TRIES = 3
"""Of a job whose worker is killed from outside: the machine is at fault before the job is."""

BREAKS = 10
"""Times in a row that all workers may die before any ends an episode."""

POLL = 0.5
"""How often the pool is looked at while nothing ends, s."""

Finished = Callable[[Done], None]

Stack = tuple[str, str, str]

Tries = list[tuple[Job, int]]
"""Jobs, each with the number of the try that is next or under way."""


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

    Raises:
        InputError: Workers die before they end any job.
    """
    with Workers(workers, bounds) as engine:
        engine(jobs, stacks, finished)


class Workers:
    """Processes that stay for one batch of jobs after another; an `Engine`, closed by `with`."""

    def __init__(self, workers: int, bounds: Bounds, fresh: bool = False) -> None:
        """Start none yet.

        Args:
            workers: Processes.
            bounds: Of one job.
            fresh: A new process for each job.
        """
        self._workers = workers
        self._bounds = bounds
        self._fresh = fresh
        self._pool: pebble.ProcessPool | None = None
        self._compiled: set[Stack] = set()

    def __enter__(self) -> Workers:
        """Return the workers themselves."""
        return self

    def __exit__(self, *_: object) -> None:
        """End all processes."""
        self._stop()

    def __call__(self, jobs: Sequence[Job], stacks: Sequence[bytes], finished: Finished) -> None:
        """Run every job; see `run_in_processes`."""
        os.environ["OPENBLAS_NUM_THREADS"] = "1"
        waiting = [(job, 1) for job in reversed(jobs)]
        broken = 0
        while waiting:
            before = len(waiting)
            pool = self._start(stacks)
            waiting = _run(pool, waiting, self._workers, self._bounds, finished)
            broken = broken + 1 if len(waiting) == before else 0
            if broken == BREAKS:
                raise InputError(f"workers died {BREAKS} times before they ended any episode")

    def _start(self, stacks: Sequence[bytes]) -> pebble.ProcessPool:
        """The pool, made anew where it broke, with these stacks compiled."""
        if self._pool is None or not self._pool.active:
            self._stop()
            self._pool = pebble.ProcessPool(
                max_workers=self._workers,
                max_tasks=int(self._fresh),
                context=multiprocessing.get_context("spawn"),
                initializer=start_worker,
                initargs=(self._bounds.memory_mib, os.getpid()),
            )
        new = {_stack(config): config for config in stacks}
        for stack in self._compiled & new.keys():
            del new[stack]
        _warm_up(self._pool, list(new.values()))
        self._compiled.update(new)
        return self._pool

    def _stop(self) -> None:
        if self._pool is not None:
            self._pool.stop()
            self._pool.join()
            self._pool = None


def _stack(config: bytes) -> Stack:
    """What decides which kernels an episode needs."""
    document = msgspec.json.decode(config)
    return document["robot"], document["map"]["kind"], document["planner"]["name"]


def _warm_up(pool: pebble.ProcessPool, stacks: Sequence[bytes]) -> None:
    """Compile before the clocks of episodes run; what fails here will tell so as an episode."""
    running = [pool.schedule(warm_up_job, args=[config]) for config in stacks]
    while pool.active and wait(running, timeout=POLL).not_done:
        pass


def _run(
    pool: pebble.ProcessPool, waiting: Tries, workers: int, bounds: Bounds, finished: Finished
) -> Tries:
    """Keep a few jobs scheduled ahead, so that a study of any length holds little.

    Returns:
        The jobs that are left where the pool broke, as it does when an idle worker is killed.
    """
    running: dict[Future[Any], tuple[Job, int]] = {}
    while (waiting or running) and pool.active:
        while waiting and len(running) < 2 * workers:
            job, tries = waiting[-1]
            try:
                future: Future[Any] = pool.schedule(run_job, args=[job], timeout=bounds.wall_s)
            except RuntimeError:  # broken since we looked
                break
            running[future] = waiting.pop()
        for future in wait(running, timeout=POLL, return_when=FIRST_COMPLETED).done:
            job, tries = running.pop(future)
            error = future.exception()
            if isinstance(error, BrokenProcessPool):
                waiting.append((job, tries))
            elif isinstance(error, pebble.ProcessExpired) and tries < TRIES:
                waiting.append((job, tries + 1))
            else:
                finished(_done(job, future, error, bounds, tries))
    return [*waiting, *running.values()]


def _done(
    job: Job, future: Future[Any], error: BaseException | None, bounds: Bounds, tries: int
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
