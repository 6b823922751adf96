"""A pool of worker processes: jobs within bounds, and tried again when a worker is killed."""

from __future__ import annotations

import multiprocessing
import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Any, Generic, NamedTuple, TypeVar

import msgspec
import pebble

from wayproof.harness.errors import InputError

TRIES = 3
"""Times that a job is started whose worker is killed: the machine is at fault before the job is."""

BREAKS = 10
"""Times in a row that all workers may die before one finishes a job."""

POLL = 0.5
"""Longest time between two looks at the pool, s."""

PARENT_POLL = 0.2
"""Time between two looks of a worker for its parent, s."""

LOCK_WAIT = 15.0
"""Longest time that a process waits for another to hand over a job or a result, s: one that was
killed meanwhile holds the lock for good, and pebble's default of 60 s passes twice then."""

THREADS = "OPENBLAS_NUM_THREADS"
"""Environment variable for the number of threads of OpenBLAS in a process."""

Value = TypeVar("Value")


class Bounds(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Time and memory that one job may take.

    Attributes:
        wall_s: Wall time, s.
        memory_mib: Private memory of its process, MiB.
    """

    wall_s: float = 900.0
    memory_mib: int = 6144

    @property
    def exceeded_time(self) -> str:
        """Error text of a job that was stopped at its wall time."""
        return f"took more than the {self.wall_s:g} s that bounds.wall_s allows"


@dataclass(frozen=True)
class Ended(Generic[Value]):
    """A job that has ended.

    Attributes:
        number: Index among the jobs of one `run`.
        value: Returned value; None if it was stopped or its process died.
        failure: Reason why it was stopped or its process died; empty if it returned.
    """

    number: int
    value: Value | None
    failure: str = ""

    def result(self) -> Value:
        """Return the value.

        Raises:
            InputError: There is none.
        """
        if self.failure:
            raise InputError(f"job {self.number}: {self.failure}")
        return self.value  # type: ignore[return-value]  # of a job that returned


class _Attempt(NamedTuple):
    """A job with its number and the number of the try that is next or under way."""

    number: int
    arguments: tuple[Any, ...]
    tries: int


class WorkerPool:
    """Spawned processes, kept from one batch of jobs to the next; closed by `with`."""

    def __init__(
        self,
        workers: int,
        bounds: Bounds | None = None,
        fresh: bool = False,
        initializer: Callable[[], None] | None = None,
    ) -> None:
        """Set the pool up; no process is started yet.

        Args:
            workers: Number of processes.
            bounds: Limits of each job; None for none.
            fresh: Start a new process for each job.
            initializer: Called first in each process.
        """
        self._workers = workers
        self._bounds = bounds
        self._fresh = fresh
        self._initializer = initializer
        self._pool: pebble.ProcessPool | None = None
        self._threads: str | None = None

    def __enter__(self) -> WorkerPool:
        """Limit OpenBLAS to one thread in the processes to come."""
        pebble.CONSTS.channel_lock_timeout = LOCK_WAIT
        self._threads = os.environ.get(THREADS)
        os.environ[THREADS] = "1"  # inherited by spawned processes
        return self

    def __exit__(self, *_: object) -> None:
        """Stop all processes."""
        self._stop()
        if self._threads is None:
            del os.environ[THREADS]
        else:
            os.environ[THREADS] = self._threads

    def run(
        self, work: Callable[..., Value], jobs: Iterable[tuple[Any, ...]], timed: bool = True
    ) -> Iterator[Ended[Value]]:
        """Call a function with the arguments of each job; yield each job as it ends.

        Args:
            work: Function of a module.
            jobs: Arguments of each call.
            timed: Stop a job at the wall time of the bounds.

        Raises:
            InputError: All workers died several times before any of them finished a job.
            Exception: Whatever `work` raises.
        """
        waiting = deque(_Attempt(number, job, 1) for number, job in enumerate(jobs))
        broken = 0
        while waiting:
            before = len(waiting)
            yield from self._run(self._start(), work, waiting, timed)
            broken = broken + 1 if len(waiting) == before else 0
            if broken == BREAKS:
                raise InputError(f"workers died {BREAKS} times before they ended any job")

    def run_in_order(
        self, work: Callable[..., Value], jobs: Sequence[tuple[Any, ...]]
    ) -> Iterator[Value]:
        """Yield the values of all jobs in the order of the jobs; arguments as for `run`.

        Raises:
            InputError: A job was stopped or its process died.
            Exception: Whatever `work` raises.
        """
        early: dict[int, Ended[Value]] = {}
        following = 0
        for ended in self.run(work, jobs):
            early[ended.number] = ended
            while following in early:
                yield early.pop(following).result()
                following += 1

    def _start(self) -> pebble.ProcessPool:
        """Return the running pool, made again if it broke."""
        if self._pool is None or not self._pool.active:
            self._stop()
            memory_mib = self._bounds.memory_mib if self._bounds else None
            self._pool = pebble.ProcessPool(
                max_workers=self._workers,
                max_tasks=int(self._fresh),
                context=multiprocessing.get_context("spawn"),
                initializer=_start_worker,
                initargs=(memory_mib, os.getpid(), self._initializer),
            )
        return self._pool

    def _stop(self) -> None:
        if self._pool is not None:
            self._pool.stop()
            self._pool.join()
            self._pool = None

    def _run(
        self,
        pool: pebble.ProcessPool,
        work: Callable[..., Value],
        waiting: deque[_Attempt],
        timed: bool,
    ) -> Iterator[Ended[Value]]:
        """Run jobs until all have ended or the pool breaks; those left go back to `waiting`.

        A pool breaks when an idle worker is killed. Only a few jobs are scheduled ahead, so that a
        study of any length takes little memory.
        """
        timeout = self._bounds.wall_s if self._bounds and timed else None
        running: dict[Future[Any], _Attempt] = {}
        while (waiting or running) and pool.active:
            while waiting and len(running) < 2 * self._workers:
                try:
                    future = pool.schedule(work, args=list(waiting[0].arguments), timeout=timeout)
                except RuntimeError:  # broken since the last look
                    break
                running[future] = waiting.popleft()
            for ended in wait(running, timeout=POLL, return_when=FIRST_COMPLETED).done:
                attempt = running.pop(ended)
                error = ended.exception()
                if isinstance(error, BrokenProcessPool):
                    waiting.appendleft(attempt)
                elif isinstance(error, pebble.ProcessExpired) and attempt.tries < TRIES:
                    waiting.appendleft(attempt._replace(tries=attempt.tries + 1))
                else:
                    yield self._ended(attempt, ended, error)
        waiting.extendleft(running.values())

    def _ended(
        self, attempt: _Attempt, future: Future[Any], error: BaseException | None
    ) -> Ended[Value]:
        if error is None:
            return Ended(attempt.number, future.result())
        if isinstance(error, TimeoutError) and self._bounds is not None:
            return Ended(attempt.number, None, self._bounds.exceeded_time)
        if isinstance(error, pebble.ProcessExpired):
            died = f"its process died {attempt.tries} times, last with exit {error.exitcode}"
            return Ended(attempt.number, None, died)
        raise error


def _start_worker(
    memory_mib: int | None, parent: int, initializer: Callable[[], None] | None
) -> None:
    """Initialise this process, bound its memory, and end it when its parent is gone."""
    pebble.CONSTS.channel_lock_timeout = LOCK_WAIT
    if initializer is not None:
        initializer()
    if memory_mib is not None:
        import resource

        limit = memory_mib * 2**20
        resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(PARENT_POLL)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
