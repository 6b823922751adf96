"""Running jobs on a Ray cluster: workers send logs back, so that nodes share no disk."""

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
"""How often the jobs under way are held against their time, s."""


def run_on_ray(
    jobs: Sequence[Job],
    stacks: Sequence[bytes],
    finished: Finished,
    *,
    workers: int,
    bounds: Bounds,
    address: str | None = None,
) -> None:
    """Run every job on Ray; each node compiles on its first.

    Args:
        jobs: What to run.
        stacks: Not needed: nodes do not share this machine's cache.
        finished: Called in this process.
        workers: Jobs at a time, where Ray is started here; a cluster has its own number.
        bounds: Of one job; memory is watched by Ray's own monitor.
        address: Of a running cluster; none starts one on this machine.

    Raises:
        InputError: Ray is not installed, or there is no cluster at the address.
    """
    try:
        import ray
    except ImportError:
        raise InputError("engine 'ray' is not installed: pip install 'wayproof[cluster]'") from None
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
    """Hand out as many jobs as the cluster has cores, so that none waits while its time runs."""
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
    """A job's answer, its log put where it belongs."""
    try:
        done, log = ray.get(reference)
    except ray.exceptions.RayError as error:
        lines = str(error).strip().splitlines()
        return Done(job.key, lines[0] if lines else type(error).__name__)
    if log:
        draft = job.log.with_suffix(".partial")
        draft.write_bytes(log)
        draft.replace(job.log)
    return done  # type: ignore[no-any-return]


def run_and_return(job: Job) -> tuple[Done, bytes]:
    """Run a job on a node and return its log with the answer."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / job.log.name
        done = run_job(replace(job, log=log))
        return done, log.read_bytes() if log.is_file() else b""
