"""The engine of studies on this machine: episodes in worker processes."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import msgspec

from wayproof.harness.study.job import Done, Job, run_job, warm_up_job
from wayproof.harness.worker_pool import Bounds, WorkerPool

Finished = Callable[[Done], None]
"""Callback for each job that has ended."""

Stack = tuple[str, str, str]
"""Robot, kind of map and planner, which decide the kernels that an episode needs."""


class ProcessEngine:
    """Worker processes kept from one batch of jobs to the next; an `Engine`, closed by `with`."""

    def __init__(self, workers: int, bounds: Bounds, fresh: bool = False) -> None:
        """Set the pool up; no process is started yet.

        Args:
            workers: Number of processes.
            bounds: Limits of one job.
            fresh: Start a new process for each job.
        """
        self._pool = WorkerPool(workers, bounds, fresh)
        self._late = bounds.exceeded_time
        self._compiled: set[Stack] = set()

    def __enter__(self) -> ProcessEngine:
        """Open the pool."""
        self._pool.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        """End all processes."""
        self._pool.__exit__()

    def __call__(self, jobs: Sequence[Job], stacks: Sequence[bytes], finished: Finished) -> None:
        """Run every job.

        Args:
            jobs: Episodes to run.
            stacks: Config of one episode of each stack among them, whose kernels are compiled
                first.
            finished: Called in this process after each job, in the order in which they end.

        Raises:
            InputError: Workers die before they end any job.
        """
        self._compile(stacks)
        for ended in self._pool.run(run_job, [(job,) for job in jobs]):
            key, died = jobs[ended.number].key, ended.failure != self._late
            finished(ended.value or Done(key, ended.failure, of_machine=died))

    def _compile(self, stacks: Sequence[bytes]) -> None:
        """Compile the kernels of new stacks before the clocks of episodes run."""
        new = {_stack(config): config for config in stacks}
        for stack in self._compiled & new.keys():
            del new[stack]
        for _ in self._pool.run(warm_up_job, [(config,) for config in new.values()], timed=False):
            pass  # a stack that cannot be compiled fails again in its episodes, with its reason
        self._compiled.update(new)


def _stack(config: bytes) -> Stack:
    document = msgspec.json.decode(config)
    return document["robot"], document["map"]["kind"], document["planner"]["name"]
