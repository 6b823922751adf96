"""Run of a study from its file to its verdict: run the missing episodes, read and judge them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

from wayproof.harness.config_document import to_json
from wayproof.harness.errors import InputError
from wayproof.harness.study.analysis import Sample, samples_of, summarise
from wayproof.harness.study.calibration import calibrations_of
from wayproof.harness.study.changes import changes_of
from wayproof.harness.study.contents import Contents, contents_of
from wayproof.harness.study.falsify import falsification_of, hunts_of
from wayproof.harness.study.file import StudyFile, files_of, gates_of
from wayproof.harness.study.gate import Gate
from wayproof.harness.study.gates import judge
from wayproof.harness.study.job import Done, Job
from wayproof.harness.study.lost import lost_of
from wayproof.harness.study.matching import ForeignLog
from wayproof.harness.study.passes import passes_of
from wayproof.harness.study.plan import Planned, name_of
from wayproof.harness.study.processes import Finished
from wayproof.harness.study.result import Answer, StudyResult
from wayproof.harness.study.rows import Row, read_row, write_table
from wayproof.harness.study.search import advance
from wayproof.harness.study.store import Store
from wayproof.harness.study.threshold import brackets_of, thresholds_of
from wayproof.harness.worker_pool import TRIES

Engine = Callable[[Sequence[Job], Sequence[bytes], Finished], None]
"""Function that runs jobs; the configs are of one episode of each stack, compiled first."""


def run_missing(
    planned: Sequence[Planned], store: Store, engine: Engine, finished: Finished
) -> None:
    """Run the episodes that are not in the folder yet; each is kept as it ends.

    One that the machine ends, for want of disk or memory, is run again when the others have ended.
    """
    jobs: dict[str, Job] = {}
    stacks: dict[object, bytes] = {}
    for one in planned:
        if one.key not in jobs and not store.is_done(one.key):
            config = to_json(one.config)
            store.forget_error(one.key)
            jobs[one.key] = Job(one.key, config, store.log(one.key), one.source)
            if one.source is not None:
                continue
            stack = (one.config.robot, one.config.map.kind, one.config.planner.name)
            stacks.setdefault(stack, config)
    waiting = list(jobs)
    for tries_left in reversed(range(TRIES)):
        again: list[str] = []

        def keep(done: Done, again: list[str] = again, last: bool = tries_left == 0) -> None:
            if done.of_machine and not last:
                again.append(done.key)
                return
            if done.error:
                store.record_error(done.key, done.error, done.of_machine)
            if done.error and not done.of_machine:
                store.keep_evidence(done.key, done.error)
            finished(done)

        if waiting:  # an engine may take seconds to start
            engine([jobs[key] for key in waiting], list(stacks.values()), keep)
        waiting = again


def count_missing(planned: Sequence[Planned], store: Store) -> int:
    """Return the number of episodes that have neither a log nor an error yet."""
    return sum(not store.is_done(one.key) for one in planned)


def shard(planned: Sequence[Planned], text: str) -> list[Planned]:
    """Return the part `i/N` of a study; an episode and its twins are in the same part.

    Raises:
        InputError: The text is not such a part.
    """
    try:
        part, parts = (int(number) for number in text.split("/"))
    except ValueError:
        part, parts = 0, 0
    if not 1 <= part <= parts:
        raise InputError(f"--shard {text}: expected i/N with 1 <= i <= N, as in 2/8")
    return [one for one in planned if one.seed % parts == part - 1]


def read_rows(planned: Sequence[Planned], store: Store, allow_plugins: bool = False) -> list[Row]:
    """Return the rows of the episodes that have ended, in the order of the plan.

    Raises:
        InputError: A log is damaged, names code that is not allowed, or is of another episode.
    """
    rows, foreign = read_own_rows(planned, store, allow_plugins)
    if foreign:
        raise InputError(foreign[0])
    return rows


def read_own_rows(
    planned: Sequence[Planned], store: Store, allow_plugins: bool = False
) -> tuple[list[Row], tuple[str, ...]]:
    """Return the rows of the episodes that have ended, and a line for each log of another episode.

    Raises:
        InputError: A log is damaged, or names code that is not allowed.
    """
    rows, foreign = [], []
    for one in planned:
        try:
            row = read_row(store, one, allow_plugins)
        except ForeignLog as error:
            foreign.append(str(error))
            continue
        if row is not None:
            rows.append(row)
    return rows, tuple(foreign)


def conclude(
    study: StudyFile,
    planned: Sequence[Planned],
    rows: Sequence[Row],
    foreign: Sequence[str] = (),
    answers: Sequence[Answer] = (),
) -> StudyResult:
    """Summarise the rows and judge the gates; a log of another episode counts as missing."""
    return replace(
        judged(study.name, gates_of(study), planned, rows, samples_of(rows)),
        foreign=tuple(foreign),
        answers=answers,
    )


def judged(
    name: str,
    gates: Sequence[Gate],
    planned: Sequence[Planned],
    rows: Sequence[Row],
    samples: Sequence[Sample],
    of_each: int = 1,
) -> StudyResult:
    """Summarise samples and judge them by gates.

    Args:
        name: Name of what is judged.
        gates: The gates.
        planned: All episodes, of one study or of two that are compared.
        rows: Rows of those that have ended.
        samples: The arms.
        of_each: Number of episodes of each arm and seed, two in a comparison.
    """
    limit = max(one.config.episode.time_limit for one in planned)
    of_recordings = planned[0].source is not None
    errors = [row for row in rows if not row.ran]
    expected = {(one.arm, one.seed) for one in planned}
    ended = Counter((row.arm, row.seed) for row in rows)
    return StudyResult(
        name=name,
        episodes=len(expected),
        missing=sum(ended[one] < of_each for one in expected),
        errors=len({(row.arm, row.seed) for row in errors}),
        first_error=error_in_words(errors[0]) if errors else "",
        arms=[] if of_recordings else summarise(samples, limit),
        lost=lost_of(
            [row for one in samples for row in one.rows],
            [pair for one in samples for pair in one.pairs] if of_each > 1 else (),
        ),
        changes=changes_of(samples, limit),
        gates=judge(samples, gates, limit),
        of_recordings=of_recordings,
        gates_set=len(gates),
    )


def answers_of(
    study: StudyFile,
    planned: Sequence[Planned],
    store: Store,
    contents: Contents,
    rows: Sequence[Row] = (),
    run: Callable[[Sequence[Planned]], None] = lambda planned: None,
) -> list[Answer]:
    """Return the answers of a study that is no grid of simulated episodes.

    Args:
        study: The study.
        planned: Its episodes, of a search the unperturbed ones.
        store: Folder of the logs.
        contents: Identities of the files that it names.
        rows: Rows of the episodes that have ended.
        run: Function that runs the missing episodes of a search; by default none is run.
    """
    if study.kind == "threshold":
        brackets = brackets_of(study, planned)
        advance(brackets, store, contents, run)
        return list(thresholds_of(brackets))
    if study.kind == "falsify":
        hunts = hunts_of(study, planned)
        advance(hunts, store, contents, run)
        return [falsification_of(one) for one in hunts]
    if study.kind == "calibrate":
        limit = max(one.config.episode.time_limit for one in planned)
        return list(calibrations_of(study, rows, limit))
    return list(passes_of(rows)) if study.recordings else []


def error_in_words(row: Row) -> str:
    """Return in words which episode failed to run and why."""
    return f"{name_of(row.arm)}, seed {row.seed}: {row.reason}"


def verdict_in_words(result: StudyResult) -> str:
    """Return the result of the study in a sentence or two."""
    ran = result.episodes - result.missing - result.errors
    reached = sum(one.outcomes.get("success", 0) for one in result.arms)
    text = f"{reached} of {ran} episodes reached the goal"
    if (pairs := result.pairs) is not None:
        text = (
            f"{pairs.reached} of {pairs.count} episodes reached the goal "
            f"(before: {pairs.reached_before} of {pairs.count})"
        )
    if result.of_recordings:
        text = f"{ran} of {result.episodes} passes through recordings judged"
    if result.differences:
        text = f"the folders differ in {'; '.join(result.differences)}. {text}"
    if result.missing:
        lacking = "have not run" if result.pairs is None else "have not run in both studies"
        text += f"; {result.missing} of {result.episodes} {lacking}"
    if result.foreign:
        text += f"; in place of {len(result.foreign)} of these lie logs of other episodes"
    if result.errors:
        text += f"; {result.errors} failed to run, first {result.first_error}"
    if not result.gates and result.answers:
        return f"{text}."
    if not result.gates:
        return f"{text}. {_gates_without_episodes(result.gates_set)}"
    gates = f"{len(result.gates)} gate{'s' if len(result.gates) > 1 else ''}"
    of_each = {
        verdict: [gate for gate in result.gates if gate.verdict == verdict]
        for verdict in ("failed", "inconclusive", "held")
    }
    counts = [f"{len(some)} {verdict}" for verdict, some in of_each.items() if some]
    text = f"{text}. Of {gates}: {', '.join(counts)}"
    worst = next(some[0] for some in of_each.values() if some)
    if worst.verdict == "held":
        return f"{text}."
    return f"{text}; first {worst.verdict}: '{worst.gate}' for {name_of(worst.arm)}."


def _gates_without_episodes(gates_set: int) -> str:
    """Return in words why a study has no result of a gate."""
    if not gates_set:
        return "No gate is set."
    some = "The gate is" if gates_set == 1 else f"The {gates_set} gates are"
    return f"{some} not judged: no episode that counts has ended."


def run_study(
    study: StudyFile,
    planned: Sequence[Planned],
    store: Store,
    engine: Engine,
    finished: Finished,
    check: Callable[[], None] | None = None,
) -> StudyResult:
    """Run the missing episodes of a study, write its table, and judge it.

    Args:
        study: The study.
        planned: Its episodes.
        store: Folder of their logs.
        engine: Engine that runs them.
        finished: Called after each episode.
        check: Called when all have ended, before their logs are read.

    Raises:
        InputError: The folder cannot be written, another run holds it, or a log is damaged.
    """
    with store.open():
        store.clear_partial()
        contents = contents_of(files_of(study))
        store.keep_study(study, contents)

        def run(some: Sequence[Planned]) -> None:
            run_missing(some, store, engine, finished)

        run(planned)
        if check is not None:
            check()
        rows, foreign = read_own_rows(planned, store, allow_plugins=True)  # the study was let in
        write_table(rows, store.folder / "table.parquet")
        answers = answers_of(study, planned, store, contents, rows, run)
    return conclude(study, planned, rows, foreign, answers)
