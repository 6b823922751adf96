"""A study from its file to its verdict: plan, run what is missing, read, judge."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from harness.config import to_json
from harness.errors import InputError
from harness.study.analysis import ArmSummary, GateResult, judge, samples_of, summarise
from harness.study.contents import contents_of
from harness.study.file import Planned, StudyFile, files_of, read_gate
from harness.study.job import Done, Job
from harness.study.processes import Finished
from harness.study.rows import Row, read_row, write_table
from harness.study.store import Store

Engine = Callable[[Sequence[Job], Sequence[bytes], Finished], None]
"""Runs jobs; the configs are one of each kind of stack, to be compiled first."""


@dataclass(frozen=True)
class StudyResult:
    """What a study says.

    Attributes:
        name: Of the study.
        episodes: That it asks for.
        missing: Of them, those not run yet.
        errors: Episodes that left no log.
        arms: Summaries.
        gates: Verdicts.
    """

    name: str
    episodes: int
    missing: int
    errors: int
    arms: list[ArmSummary]
    gates: list[GateResult]

    @property
    def exit_code(self) -> int:
        """0 all ran and no gate failed, 1 a gate failed, 3 incomplete."""
        if self.missing:
            return 3
        return 1 if any(gate.verdict == "failed" for gate in self.gates) else 0


def run_missing(
    planned: Sequence[Planned], store: Store, engine: Engine, finished: Finished
) -> None:
    """Run the episodes that the folder does not hold yet; each that ends is kept at once."""
    jobs: dict[str, Job] = {}
    stacks: dict[object, bytes] = {}
    for one in planned:
        if one.key not in jobs and not store.is_done(one.key):
            config = to_json(one.config)
            jobs[one.key] = Job(one.key, config, store.log(one.key))
            stack = (one.config.robot, one.config.map.kind, one.config.planner.name)
            stacks.setdefault(stack, config)

    def keep(done: Done) -> None:
        if done.error:
            store.record_error(done.key, done.error)
        finished(done)

    if jobs:  # an engine may take seconds to start
        engine(list(jobs.values()), list(stacks.values()), keep)


def count_missing(planned: Sequence[Planned], store: Store) -> int:
    """Episodes that have neither a log nor an error yet."""
    return sum(not store.is_done(one.key) for one in planned)


def shard(planned: Sequence[Planned], text: str) -> list[Planned]:
    """The part `i/N` of a study; an episode and its twins fall into the same.

    Raises:
        InputError: It is no part.
    """
    try:
        part, parts = (int(number) for number in text.split("/"))
    except ValueError:
        part, parts = 0, 0
    if not 1 <= part <= parts:
        raise InputError(f"--shard {text}: expected i/N with 1 <= i <= N, as in 2/8")
    return [one for one in planned if one.seed % parts == part - 1]


def read_rows(planned: Sequence[Planned], store: Store, allow_plugins: bool = False) -> list[Row]:
    """Rows of the episodes that have ended, in the order of the plan.

    Raises:
        InputError: A log is damaged, or names code that is not allowed.
    """
    rows = (read_row(store, one, allow_plugins) for one in planned)
    return [row for row in rows if row is not None]


def conclude(study: StudyFile, planned: Sequence[Planned], rows: Sequence[Row]) -> StudyResult:
    """Summarise the rows and hold them against the gates."""
    limit = max(one.config.episode.time_limit for one in planned)
    samples = samples_of(rows, planned[0].arm.variant)
    return StudyResult(
        name=study.name,
        episodes=len(planned),
        missing=len(planned) - len(rows),
        errors=sum(row.outcome == "error" for row in rows),
        arms=summarise(samples, limit),
        gates=judge(samples, [read_gate(text) for text in study.gates]),
    )


def run_study(
    study: StudyFile, planned: Sequence[Planned], store: Store, engine: Engine, finished: Finished
) -> StudyResult:
    """Run what is missing of a study, write its table, and judge it.

    Raises:
        InputError: The folder cannot be written, another run holds it, or a log is damaged.
    """
    with store.open():
        store.clear_partial()
        run_missing(planned, store, engine, finished)
        rows = read_rows(planned, store, allow_plugins=True)  # they were run or let in here
        write_table(rows, planned[0].arm.variant, store.folder / "table.parquet")
        store.keep_study(study, contents_of(files_of(study)))
    return conclude(study, planned, rows)
