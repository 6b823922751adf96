"""Comparison of two runs of a study, arm by arm and seed by seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from wayproof.harness.errors import InputError
from wayproof.harness.study.analysis import Sample, samples_between, summarise
from wayproof.harness.study.file import read_gate
from wayproof.harness.study.gates import judge
from wayproof.harness.study.plan import Arm, Planned, plan_episodes
from wayproof.harness.study.rows import Row
from wayproof.harness.study.store import Store
from wayproof.harness.study.study import Paired, StudyResult, error_in_words, read_own_rows


@dataclass(frozen=True)
class Compared:
    """Comparison of two folders.

    Attributes:
        result: Its verdict.
        samples: The arms with their pairs.
        time_limit: Greatest time limit of an episode of either folder, s.
    """

    result: StudyResult
    samples: list[Sample]
    time_limit: float


def compare(
    before: Path, after: Path, gates: Sequence[str], allow_plugins: bool = False
) -> Compared:
    """Compare the episodes of the second folder with those of the first.

    Episodes of either folder without a partner in the other count as missing. Where each folder has
    one stack that the other lacks, these are two builds of one stack, and are compared.

    Raises:
        InputError: A folder is not one of a study, a gate is malformed, or no episode is shared.
    """
    judged = [read_gate(text) for text in gates]
    planned, rows, foreign = _read(after, allow_plugins)
    planned_before, rows_before, foreign_before = _read(before, allow_plugins)
    renamed = _renamed(planned_before, planned)
    planned_before = [replace(one, arm=_in_terms_of(renamed, one.arm)) for one in planned_before]
    rows_before = [replace(one, arm=_in_terms_of(renamed, one.arm)) for one in rows_before]
    samples = samples_between(rows_before, rows)
    if not any(sample.pairs for sample in samples):
        raise InputError(f"'{before}' and '{after}' have no arm and seed in common")
    of_recordings = planned[0].source is not None
    limit = max(one.config.episode.time_limit for one in (*planned_before, *planned))
    expected = {(one.arm, one.seed) for one in (*planned, *planned_before)}
    kept, kept_before = ({(row.arm, row.seed) for row in some} for some in (rows, rows_before))
    errors = [row for row in (*rows, *rows_before) if not row.ran]
    pairs = [pair for sample in samples for pair in sample.pairs]
    result = StudyResult(
        name=f"{after} against {before}",
        episodes=len(expected),
        missing=len(expected - (kept & kept_before)),
        errors=len({(row.arm, row.seed) for row in errors}),
        first_error=error_in_words(errors[0]) if errors else "",
        arms=[] if of_recordings else summarise(samples, limit),
        gates=judge(samples, judged, limit),
        foreign=(*foreign_before, *foreign),
        of_recordings=of_recordings,
        gates_set=len(judged),
        pairs=Paired(
            count=len(pairs),
            reached=sum(row.success for _, row in pairs),
            reached_before=sum(twin.success for twin, _ in pairs),
        ),
    )
    return Compared(result, samples, limit)


def _renamed(before: Sequence[Planned], after: Sequence[Planned]) -> dict[str, str]:
    """Return the stack that only the first study has -> the one that only the second has."""
    first, second = ({one.arm.stack for one in planned} for planned in (before, after))
    old, new = sorted(first - second), sorted(second - first)
    return dict(zip(old, new, strict=True)) if len(old) == len(new) == 1 else {}


def _in_terms_of(renamed: Mapping[str, str], arm: Arm) -> Arm:
    """Return an arm with the new name of its stack."""
    return replace(arm, stack=renamed.get(arm.stack, arm.stack))


def _read(folder: Path, allow_plugins: bool) -> tuple[list[Planned], list[Row], tuple[str, ...]]:
    store = Store(folder)
    planned = plan_episodes(store.read_study(allow_plugins), store.read_contents())
    return planned, *read_own_rows(planned, store, allow_plugins)
