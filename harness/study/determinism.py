"""Certificate that the episodes of a study do not depend on how they are run.

A sample of the finished episodes is run again in other processes and in another order. The chain
hash over all decisions, each with the hash of its inputs, must be the same.
"""

from __future__ import annotations

import tempfile
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wayproof.harness.config_document import to_json
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.study.job import Done, Job
from wayproof.harness.study.plan import Planned, name_of
from wayproof.harness.study.processes import Finished, ProcessEngine
from wayproof.harness.study.store import Store
from wayproof.harness.worker_pool import Bounds

FILE = "determinism.json"
"""File name of the latest certificate in the folder of a study."""

SAMPLE = 8
"""Default number of episodes run again in each arrangement."""


@dataclass(frozen=True)
class Arrangement:
    """Way to run the episodes.

    Attributes:
        name: Name in words.
        workers: Number of processes.
        fresh: Start a new process for each episode.
        order: Order of the episodes: `reversed` or `shuffled`.
    """

    name: str
    workers: int
    fresh: bool
    order: str


ARRANGEMENTS = (
    Arrangement("a new process for each, in reverse", workers=1, fresh=True, order="reversed"),
    Arrangement("two processes, shuffled", workers=2, fresh=False, order="shuffled"),
)


@dataclass(frozen=True)
class Rerun:
    """One episode run again.

    Attributes:
        key: Key of the episode.
        arrangement: Name of the arrangement.
        chain: Hash over its decisions; empty without a log.
        identical: Whether the chain is that of the study.
        error: Reason why there is no log; empty with one.
    """

    key: str
    arrangement: str
    chain: str
    identical: bool
    error: str


@dataclass(frozen=True)
class Certificate:
    """Reruns of a sample of a study, and whether all are identical.

    Attributes:
        study: Name of the study.
        identical: Whether every rerun gave the chain of the study.
        episodes: Number of finished episodes.
        left_out: Number of finished episodes timed by the wall clock (`latency.mode = measured`),
            which cannot be repeated.
        sample: Key -> arm, seed and chain of each episode of the sample.
        arrangements: Arrangements of the reruns.
        reruns: One rerun of each episode in each arrangement.
        versions: Versions in the logs of the sample.
    """

    study: str
    identical: bool
    episodes: int
    left_out: int
    sample: dict[str, dict[str, str | int]]
    arrangements: tuple[Arrangement, ...]
    reruns: list[Rerun]
    versions: dict[str, str]


def certify(
    name: str,
    planned: Sequence[Planned],
    store: Store,
    bounds: Bounds,
    finished: Finished,
    size: int = SAMPLE,
    arrangements: tuple[Arrangement, ...] = ARRANGEMENTS,
) -> Certificate:
    """Run a sample of a study's finished episodes again, and write the certificate to its folder.

    Args:
        name: Name of the study.
        planned: Episodes of the study.
        store: Folder of the study.
        bounds: Limits of one episode.
        finished: Called after each rerun.
        size: Number of episodes of the sample.
        arrangements: Arrangements to run it in.

    Raises:
        InputError: No episode has finished that could be run again.
    """
    done = [one for one in planned if store.log(one.key).is_file()]
    steady = [one for one in done if one.config.latency.mode == "modelled"]
    if not steady:
        raise InputError(
            f"study folder '{store.folder}': no finished episode with latency.mode = modelled, "
            "expected at least one to run again"
        )
    sample = draw(steady, size)
    logs = {one.key: open_log(store.log(one.key), allow_plugins=True) for one in sample}
    chains = {key: log.result["chain"] for key, log in logs.items()}
    reruns = [
        rerun
        for arrangement in arrangements
        for rerun in _run_again(sample, chains, arrangement, bounds, finished)
    ]
    certificate = Certificate(
        study=name,
        identical=all(rerun.identical for rerun in reruns),
        episodes=len(done),
        left_out=len(done) - len(steady),
        sample={
            one.key: {"arm": name_of(one.arm), "seed": one.seed, "chain": chains[one.key]}
            for one in sample
        },
        arrangements=arrangements,
        reruns=reruns,
        versions={
            name: text for name, text in logs[sample[0].key].run.items() if "sha256" not in name
        },
    )
    store.keep(FILE, certificate)
    return certificate


def draw(planned: Sequence[Planned], size: int) -> list[Planned]:
    """Draw episodes in the order of their hashes, from each arm in turn."""
    by_arm: dict[object, deque[Planned]] = {}
    for one in sorted(planned, key=lambda one: one.key):
        by_arm.setdefault(one.arm, deque()).append(one)
    waiting = deque(sorted(by_arm.values(), key=lambda some: some[0].key))
    drawn: list[Planned] = []
    while waiting and len(drawn) < size:
        some = waiting.popleft()
        drawn.append(some.popleft())
        if some:
            waiting.append(some)
    return drawn


def _run_again(
    sample: Sequence[Planned],
    chains: dict[str, str],
    arrangement: Arrangement,
    bounds: Bounds,
    finished: Finished,
) -> list[Rerun]:
    order = list(reversed(sample))
    if arrangement.order == "shuffled":
        np.random.default_rng(len(sample)).shuffle(order)
    with tempfile.TemporaryDirectory() as folder:
        jobs = [
            Job(one.key, to_json(one.config), Path(folder) / f"{one.key}.mcap", one.source)
            for one in order
        ]
        errors: dict[str, str] = {}

        def note(done: Done) -> None:
            errors[done.key] = done.error
            finished(done)

        workers = min(arrangement.workers, len(jobs))
        with ProcessEngine(workers, bounds, arrangement.fresh) as engine:
            engine(jobs, [], note)  # their kernels were compiled for the study
        return [
            _compare(
                job.key,
                log=job.log,
                expected=chains[job.key],
                arrangement=arrangement,
                error=errors[job.key],
            )
            for job in jobs
        ]


def _compare(key: str, log: Path, expected: str, arrangement: Arrangement, error: str) -> Rerun:
    chain = open_log(log, allow_plugins=True).result["chain"] if not error else ""
    return Rerun(
        key, arrangement=arrangement.name, chain=chain, identical=chain == expected, error=error
    )
