"""The same study run by two builds, arm by arm and seed by seed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from harness.errors import InputError
from harness.study.analysis import judge, samples_between, summarise
from harness.study.file import plan_episodes, read_gate
from harness.study.rows import Row
from harness.study.store import Store
from harness.study.study import StudyResult, read_rows


def compare(
    before: Path, after: Path, gates: Sequence[str], allow_plugins: bool = False
) -> StudyResult:
    """Hold the second folder's episodes against the first's.

    Raises:
        InputError: A folder is none of a study, a gate is none, or the two share no episode.
    """
    judged = [read_gate(text) for text in gates]
    store = Store(after)
    study = store.read_study(allow_plugins)
    planned = plan_episodes(study, store.read_contents())
    rows = read_rows(planned, store, allow_plugins)
    samples = samples_between(_rows(before, allow_plugins), rows)
    if not any(sample.pairs for sample in samples):
        raise InputError(f"'{before}' and '{after}' have no arm and seed in common")
    limit = max(one.config.episode.time_limit for one in planned)
    return StudyResult(
        name=f"{after} against {before}",
        episodes=len(planned),
        missing=len(planned) - len(rows),
        errors=sum(row.outcome == "error" for row in rows),
        arms=summarise(samples, limit),
        gates=judge(samples, judged),
    )


def _rows(folder: Path, allow_plugins: bool) -> list[Row]:
    store = Store(folder)
    planned = plan_episodes(store.read_study(allow_plugins), store.read_contents())
    return read_rows(planned, store, allow_plugins)
