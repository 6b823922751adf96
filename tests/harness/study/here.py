"""Studies made by hand: files, rows, and engines that run their episodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from wayproof.harness.config import Config
from wayproof.harness.log.writer import LogWriter
from wayproof.harness.metrics import METRICS
from wayproof.harness.scenario.scenario import build
from wayproof.harness.study.contents import contents_of
from wayproof.harness.study.file import StudyFile
from wayproof.harness.study.job import Done, Job, run_job
from wayproof.harness.study.plan import Arm, Planned, plan_episodes, reference_of
from wayproof.harness.study.processes import Finished, ProcessEngine
from wayproof.harness.study.rows import Row
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import Engine, answers_of, run_missing
from wayproof.harness.worker_pool import Bounds

HEAD = """
name = "small"
worlds = ["empty"]
robots = ["drone"]
"""

BRIEF = """
[set]
"episode.time_limit" = 1
"map.resolution" = 0.2
"""

SMALL = f"{HEAD}seeds = 2{BRIEF}"
"""Study of two episodes that last a second each."""

ARM = Arm("warehouse", "drone", "", "none", 0)


def written(folder: Path, text: str = SMALL) -> str:
    """Write a study's file, and return its path."""
    path = folder / "study.toml"
    path.write_text(text)
    return str(path)


def row(seed: int, arm: Arm = ARM, outcome: str = "success", **known: Any) -> Row:
    """Return a row made by hand: figures by the name of their metric, all else by its own."""
    figures = {**dict.fromkeys(METRICS), "success": float(outcome == "success"), "collisions": 0.0}
    figures |= {name: known.pop(name) for name in METRICS if name in known}
    made = Row(f"{arm}{seed}", arm, seed, outcome, "", "", "", 6.0, figures, ())
    return replace(made, **known)


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


def refuse(jobs: Sequence[Job], *_: object) -> None:
    """An engine for what needs none."""
    raise AssertionError(f"{len(jobs)} episodes run again")


def answer(study: StudyFile, folder: Path, engine: Engine) -> Any:
    """Return what a study of one search answers, with the episodes that it asks for."""
    store = Store(folder)

    def run(some: Sequence[Planned]) -> None:
        run_missing(some, store, engine, lambda done: None)

    with store.open():
        [found] = answers_of(study, plan_episodes(study), store, contents_of([]), run=run)
    return found


@cache
def mission() -> bytes:
    """Return that of an empty world."""
    return build(Config("empty", "drone", 0)).mission.to_json()


def pretend(job: Job, outcome: str, **result: str) -> Done:
    """Write the log of an episode that was not simulated."""
    with LogWriter(job.log, job.config, mission(), "<mujoco/>") as log:
        log.finish({"outcome": outcome, "reason": outcome, "chain": "", **result})
    return Done(job.key)
