"""The engine of studies on a Ray cluster; workers send their logs back, so nodes share no disk."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from wayproof.harness.errors import InputError
from wayproof.harness.study.job import Done, Job, run_job
from wayproof.harness.study.processes import Finished
from wayproof.harness.worker_pool import TRIES, Bounds

POLL = 1.0
"""Period of the check of running jobs against their wall time, s."""


def run_on_ray(
    jobs: Sequence[Job],
    stacks: Sequence[bytes],
    finished: Finished,
    *,
    workers: int,
    bounds: Bounds,
    address: str | None = None,
) -> None:
    """Run every job on Ray; each node compiles the kernels in its first job.

    Args:
        jobs: Episodes to run.
        stacks: Unused: nodes do not share this machine's cache of kernels.
        finished: Called in this process after each job.
        workers: Number of jobs at a time if Ray is started here; a cluster has its own number.
        bounds: Limits of one job; memory is limited by Ray's own monitor.
        address: Address of a running cluster; None starts one on this machine.

    Raises:
        InputError: Ray is not installed, or there is no cluster at the address.
    """
    try:
        import ray
    except ImportError:
        raise InputError(
            "engine 'ray' is not installed: pip install ray (the extra 'cluster')"
        ) from None
    environment = {"env_vars": {"OPENBLAS_NUM_THREADS": "1"}}
    here: dict[str, Any] = {}
    if address is None:
        here = {"num_cpus": workers, "include_dashboard": False}
    started = not ray.is_initialized()
    if started:
        try:
            ray.init(address=address, runtime_env=environment, log_to_driver=False, **here)
        except (ConnectionError, ValueError, RuntimeError) as error:
            text = " ".join(str(error).split())
            raise InputError(f"no Ray cluster at '{address}': {text}") from None
    try:
        _run(ray, jobs, bounds, finished)
    finally:
        if started:
            ray.shutdown()


def _run(ray: Any, jobs: Sequence[Job], bounds: Bounds, finished: Finished) -> None:
    """Submit as many jobs as the cluster has cores, so that none waits while its time runs."""
    remote = ray.remote(num_cpus=1, max_retries=TRIES - 1)(run_and_return)
    waiting = list(reversed(jobs))
    running: dict[Any, tuple[Job, float]] = {}
    while waiting or running:
        cores = max(1, int(ray.cluster_resources().get("CPU", 1)))
        while waiting and len(running) < cores:
            job = waiting.pop()
            running[remote.remote(job)] = job, time.monotonic()
        ready, _ = ray.wait(list(running), num_returns=1, timeout=POLL)
        for reference in ready:
            job, _ = running.pop(reference)
            finished(_collect(ray, reference, job))
        for reference, (job, began) in list(running.items()):
            if time.monotonic() - began > bounds.wall_s:
                del running[reference]
                ray.cancel(reference, force=True)
                finished(Done(job.key, bounds.exceeded_time))


def _collect(ray: Any, reference: Any, job: Job) -> Done:
    """Return the outcome of a job, and store its log."""
    try:
        done, log = ray.get(reference)
    except ray.exceptions.RayError as error:
        lines = str(error).strip().splitlines()
        return Done(job.key, lines[0] if lines else type(error).__name__, of_machine=True)
    if log:
        draft = job.log.with_suffix(".partial")
        draft.write_bytes(log)
        draft.replace(job.log)
    return done  # type: ignore[no-any-return]


def run_and_return(job: Job) -> tuple[Done, bytes]:
    """Run a job on a node; return its outcome and its log."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / job.log.name
        done = run_job(replace(job, log=log))
        return done, log.read_bytes() if log.is_file() else b""
